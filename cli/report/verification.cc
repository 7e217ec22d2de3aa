// SPDX-License-Identifier: Apache-2.0
#include "cli/report/verification.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include "base/image_files.h"
#include "base/statistics.h"
#include "btf/interpolated_set.h"
#include "btf/material.h"
#include "cli/report/pictures.h"
#include "cli/report/recorded_run.h"
#include "render/scene.h"
#include "simulation/bench/material.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using simulation::Bench;
using simulation::BenchLight;

std::vector<BenchLight> bench_lights(const std::vector<render::Light>& lights) {
  std::vector<BenchLight> result;
  for (const render::Light& light : lights) {
    if (const auto* directional = std::get_if<render::DirectionalLight>(&light)) {
      result.push_back({BenchLight::Kind::kDirectional,
                        directional->direction_to_light,
                        directional->illuminance_rgb});
    } else {
      const auto& point = std::get<render::PointLight>(light);
      result.push_back({BenchLight::Kind::kPoint, point.position, point.intensity_rgb});
    }
  }
  return result;
}

/// The code values in a frame's file, undone as FileOutput made them.
Result<Image<Rgb16>> read_codes(const fs::path& path, int bits) {
  VENEER_ASSIGN(Image<Rgb16> image, read_png16(path));
  const double scale = ((1U << static_cast<unsigned>(bits)) - 1) / 65535.0;
  for (Rgb16& pixel : image.pixels()) {
    for (std::uint16_t& code : pixel) code = static_cast<std::uint16_t>(std::lround(code * scale));
  }
  return image;
}

/// What the eye should have received, of the one kind or the other.
class Truth {
 public:
  [[nodiscard]] static Result<Truth> open(const VerificationOptions& options) {
    Truth truth;
    if (options.set.empty()) {
      VENEER_ASSIGN(truth.material_, btf::load_material(options.material));
    } else {
      VENEER_ASSIGN(btf::SampleSet set, btf::SampleSet::open(options.set));
      truth.set_ = std::make_unique<const btf::InterpolatedSet>(std::move(set));
    }
    return truth;
  }
  /// Borrows from this.
  [[nodiscard]] simulation::TexelSource source() const {
    return set_ ? simulation::texel_source(*set_) : simulation::texel_source(*material_);
  }

 private:
  std::unique_ptr<const btf::InterpolatedSet> set_;
  std::unique_ptr<const btf::Material> material_;
};

/// dE00 of the covered pixels, split by whether they are within gamut, over several frames.
struct Pool {
  std::vector<double> within_gamut;
  std::vector<double> covered;

  void add(const simulation::Comparison& comparison) {
    const auto de00 = comparison.de00.pixels();
    for (std::size_t i = 0; i < de00.size(); ++i) {
      if (std::isnan(de00[i])) continue;
      covered.push_back(static_cast<double>(de00[i]));
      if (comparison.in_gamut.pixels()[i] != 0)
        within_gamut.push_back(static_cast<double>(de00[i]));
    }
  }
};

simulation::DifferenceStatistics statistics(const std::vector<double>& de00) {
  simulation::DifferenceStatistics result;
  result.count = static_cast<std::int64_t>(de00.size());
  result.mean = mean(de00);
  result.p95 = quantile(de00, 0.95);
  result.max = quantile(de00, 1);
  return result;
}

/// Differences with what is out of gamut taken out.
Image<Rgb8> difference_picture(const simulation::Comparison& comparison) {
  Image<float> de00 = comparison.de00;
  for (std::size_t i = 0; i < de00.pixels().size(); ++i) {
    if (comparison.in_gamut.pixels()[i] == 0) de00.pixels()[i] = std::nanf("");
  }
  return picture_of_differences(de00.view(), kDifferenceScale);
}

/// Writes the pictures of one frame, or none.
class PictureWriter {
 public:
  PictureWriter(fs::path folder, double white_luminance)
      : folder_(std::move(folder)), white_luminance_(white_luminance) {}

  [[nodiscard]] Status codes(std::string_view kind,
                             std::uint64_t frame,
                             const Image<Rgb16>& codes,
                             int bits) const {
    return folder_.empty() ? Status{} : write(kind, frame, picture_of_codes(codes.view(), bits));
  }
  [[nodiscard]] Status xyz(std::string_view kind,
                           std::uint64_t frame,
                           const Image<Rgb32f>& xyz) const {
    return folder_.empty() ? Status{}
                           : write(kind, frame, picture_of_xyz(xyz.view(), white_luminance_));
  }
  [[nodiscard]] Status difference(std::string_view kind,
                                  std::uint64_t frame,
                                  const simulation::Comparison& comparison) const {
    return folder_.empty() ? Status{} : write(kind, frame, difference_picture(comparison));
  }

 private:
  [[nodiscard]] Status write(std::string_view kind,
                             std::uint64_t frame,
                             const Image<Rgb8>& picture) const {
    return write_png(folder_ / fmt::format("{}-{:06}.png", kind, frame), picture.view());
  }
  fs::path folder_;
  double white_luminance_;
};

}  // namespace

Result<RunVerification> verify_run(const VerificationOptions& options, Progress& progress) {
  if (options.every < 1) {
    return fail(Errc::kInvalidOption, "verifying: every {}-th frame makes no sense", options.every);
  }
  VENEER_ASSIGN(const RecordedRun run, RecordedRun::open(options.run));
  std::map<std::uint64_t, fs::path> uncompensated;
  if (!options.uncompensated.empty()) {
    VENEER_ASSIGN(const std::vector<RecordedFrame> frames, run.frames_in(options.uncompensated));
    for (const RecordedFrame& frame : frames) uncompensated.emplace(frame.number, frame.file);
  }
  VENEER_ASSIGN(const render::Scene scene, render::Scene::load(run.scene()));
  VENEER_ASSIGN(const std::unique_ptr<Bench> bench, Bench::load(options.bench));
  const int bits = bench->truth().projector.bits;
  if (bench->truth().object.mesh != scene.mesh_name || bits != run.bits()) {
    return fail(Errc::kInvalidOption,
                "verifying {}: the run is for the mesh \"{}\" and {} bits, the bench {} has \"{}\" "
                "and {} bits",
                options.run.string(),
                scene.mesh_name,
                run.bits(),
                options.bench.string(),
                bench->truth().object.mesh,
                bits);
  }
  VENEER_ASSIGN(const Truth truth, Truth::open(options));
  const simulation::TexelSource material = truth.source();
  const std::vector<BenchLight> lights = bench_lights(scene.lights);
  VENEER_ASSIGN(const Xyz white, bench->white(scene.world_from_object));
  const PictureWriter pictures(options.pictures, white.y());

  RunVerification result;
  Pool pool;
  Pool uncompensated_pool;
  const std::vector<RecordedFrame>& frames = run.frames();
  const auto count = (static_cast<std::int64_t>(frames.size()) + options.every - 1) / options.every;
  progress.start("looking at frames on the virtual bench", count);
  for (std::size_t i = 0; i < frames.size(); i += static_cast<std::size_t>(options.every)) {
    const RecordedFrame& frame = frames[i];
    VerifiedFrame verified;
    verified.number = frame.number;
    verified.eye_in_world = run.world_from_body(scene.observer_bodies.front(), frame.display_time) *
                            scene.eye_in_sensor;
    const RigidTransform world_from_object =
        scene.object_body < 0
            ? scene.world_from_object
            : run.world_from_body(scene.object_body, frame.display_time) * scene.world_from_object;

    VENEER_ASSIGN(const simulation::EyeView view,
                  bench->look(world_from_object, verified.eye_in_world));
    const Image<Rgb32f> target =
        bench->material_truth(view, material, scene.texture_repeats, lights);
    VENEER_ASSIGN(const Image<Rgb16> codes, read_codes(frame.file, bits));
    VENEER_ASSIGN(const Image<Rgb32f> received, bench->observe(view, codes.view()));
    VENEER_ASSIGN(const simulation::Comparison comparison, bench->compare(view, target, received));
    pool.add(comparison);
    verified.within_gamut = comparison.within_gamut;
    verified.covered = comparison.covered;
    verified.in_gamut_fraction = comparison.in_gamut_fraction;
    result.partial += comparison.partial;
    result.unlit += comparison.unlit;
    result.target_over_white += comparison.target_over_white;
    VENEER_TRY(pictures.codes("projector", frame.number, codes, bits));
    VENEER_TRY(pictures.xyz("target", frame.number, target));
    VENEER_TRY(pictures.xyz("received", frame.number, received));
    VENEER_TRY(pictures.difference("difference", frame.number, comparison));

    if (const auto raw_file = uncompensated.find(frame.number); raw_file != uncompensated.end()) {
      VENEER_ASSIGN(const Image<Rgb16> raw_codes, read_codes(raw_file->second, bits));
      VENEER_ASSIGN(const Image<Rgb32f> raw, bench->observe(view, raw_codes.view()));
      VENEER_ASSIGN(const simulation::Comparison raw_comparison, bench->compare(view, target, raw));
      uncompensated_pool.add(raw_comparison);
      verified.uncompensated_mean = raw_comparison.within_gamut.mean;
      VENEER_TRY(pictures.xyz("uncompensated", frame.number, raw));
      VENEER_TRY(pictures.difference("uncompensated_difference", frame.number, raw_comparison));
    }
    result.frames.push_back(verified);
    progress.advance(1);
  }
  if (pool.covered.empty()) {
    return fail(
        Errc::kBadFormat,
        "verifying {}: in none of its frames does the bench's eye see the object; do scene and "
        "bench agree on where the observer walks?",
        options.run.string());
  }
  result.within_gamut = statistics(pool.within_gamut);
  result.covered = statistics(pool.covered);
  result.uncompensated = statistics(uncompensated_pool.within_gamut);
  result.in_gamut_fraction =
      static_cast<double>(pool.within_gamut.size()) / static_cast<double>(pool.covered.size());
  progress.finish(fmt::format(
      "dE00 {:.2f} mean, {:.2f} at 95 %", result.within_gamut.mean, result.within_gamut.p95));
  return result;
}

}  // namespace veneer::cli
