// SPDX-License-Identifier: Apache-2.0
#include "render/benchmark.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "btf/mapped_material.h"
#include "render/compensate_pass.h"
#include "render/draw_pass.h"
#include "render/draw_target.h"
#include "render/drawing.h"
#include "render/egl_context.h"
#include "render/level_draws.h"
#include "render/scene_check.h"
#include "render/screen_error.h"
#include "render/turns.h"
#include "render/upsample_pass.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kTargetBytes = 8 + 4;  // of a pixel, with depth
// Frames and pixels that are compared with the set: enough for an epsilon steady to about a
// percent.
constexpr int kComparedFrames = 3;
constexpr int kComparedStep = 7;
constexpr int kComparedPixels = 20'000;
const DirectionalLight kLight{Vector3d(0.3, -0.4, -0.9).normalized(),
                              Vector3d::Constant(100.0 * std::numbers::pi)};

// A projector at the origin and, half a metre off, a surface that fills its raster and a little
// more. The machine itself is the simplest there is; what it shows is of no interest here.
calibration::ProjectorProfile bench_profile(int width, int height) {
  calibration::ProjectorProfile profile;
  profile.geometry.width = width;
  profile.geometry.height = height;
  profile.geometry.fx = profile.geometry.fy = 1.5 * width;
  profile.geometry.cx = 0.5 * width;
  profile.geometry.cy = 0.5 * height;
  profile.reference_distance_m = 0.5;
  profile.vignetting = Image<float>(1, 1, 1.0F);
  profile.primaries = 300.0 * xyz_from_srgb();
  for (auto& curve : profile.tone_curves) {
    for (int code = 0; code < 256; ++code) curve.push_back(std::pow(code / 255.0, 2.2));
  }
  return profile;
}

// The point of the surface that is seen at (x, y), which run over the raster from 0 to 1.
Vector3d surface_point(const calibration::ProjectorGeometry& g, double x, double y) {
  const double bulge = std::cos(3.0 * (x - 0.5)) * std::cos(3.0 * (y - 0.5));
  const double depth = 0.5 - 0.05 * bulge;
  return depth * Vector3d((x * g.width - g.cx) / g.fx, (y * g.height - g.cy) / g.fy, 1.0);
}

Mesh frame_filling_mesh(const calibration::ProjectorGeometry& g) {
  constexpr int kColumns = 64;
  constexpr int kRows = 48;
  constexpr double kMargin = 0.06;
  constexpr double kStep = 1e-5;
  Mesh mesh;
  for (int j = 0; j <= kRows; ++j) {
    for (int i = 0; i <= kColumns; ++i) {
      const double x = std::lerp(-kMargin, 1.0 + kMargin, static_cast<double>(i) / kColumns);
      const double y = std::lerp(-kMargin, 1.0 + kMargin, static_cast<double>(j) / kRows);
      const Vector3d right = surface_point(g, x + kStep, y) - surface_point(g, x - kStep, y);
      const Vector3d down = surface_point(g, x, y + kStep) - surface_point(g, x, y - kStep);
      mesh.positions.push_back(surface_point(g, x, y));
      mesh.normals.push_back(down.cross(right).normalized());  // towards the projector
      mesh.texture_coordinates.emplace_back(x, y);
    }
  }
  const auto vertex = [](int i, int j) {
    return static_cast<std::uint32_t>(j * (kColumns + 1) + i);
  };
  for (int j = 0; j < kRows; ++j) {
    for (int i = 0; i < kColumns; ++i) {
      mesh.triangles.push_back({vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1)});
      mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j + 1), vertex(i + 1, j)});
    }
  }
  return mesh;
}

// One thing to time: a draw, with what brings it to the whole raster where it is on a smaller one;
// this alone; or the compensation of what was drawn before it.
struct Entrant {
  RenderTiming timing;
  std::optional<DrawPass> pass;
  std::optional<DrawTarget> smaller;
  std::optional<CompensatePass> compensate;
};

class Bench {
 public:
  static Result<Bench> create(EglContext context, const RenderBenchOptions& options) {
    const calibration::ProjectorProfile profile = bench_profile(options.width, options.height);
    VENEER_ASSIGN(DrawTarget target, DrawTarget::create({options.width, options.height}));
    VENEER_ASSIGN(UpsamplePass upsample, UpsamplePass::create());
    Bench bench(std::move(context),
                profile,
                options.texels_per_pixel,
                std::move(target),
                std::move(upsample));
    const btf::ModelShader plain = plain_textures();
    VENEER_TRY(bench.add("plain",
                         plain,
                         DrawPass::create_plain(
                             plain, {kLight}, bench.repeats(kPlainTexels, kPlainTexels), profile)));
    for (const auto& [name, material, cache, average_texels, evaluation, scale] :
         options.materials) {
      const btf::ModelShader shader = material->shader();
      const Eigen::Vector2d repeats = bench.repeats(material->width(), material->height());
      const DrawOptions draw{.cache = cache,
                             .filter = texel_filter(*material, average_texels),
                             .evaluation = evaluation,
                             .scale = scale};
      VENEER_TRY(
          bench.add(name, shader, DrawPass::create(shader, {kLight}, repeats, profile, draw)));
    }
    VENEER_TRY(bench.add_interpolations());
    VENEER_TRY(bench.add_compensation("compensation", profile));
    calibration::ProjectorProfile with_segment = profile;
    with_segment.residual = calibration::ColourResidual::sampled(
        17, [](const Vector3d& t) -> Vector3d { return 0.25 * t.minCoeff() * Vector3d::Ones(); });
    VENEER_TRY(bench.add_compensation("compensation with residual", with_segment));
    return bench;
  }

  Result<RenderBenchResult> run(const RenderBenchOptions& options, Progress& progress) {
    Turns turns(context_, entrants_.size());
    turns.run(
        options.frames,
        [this](std::size_t which, int frame) { draw(entrants_[which], frame); },
        progress);
    note_served(options.frames - 1);
    if (options.reference != nullptr)
      VENEER_TRY(compare(*options.reference, options.reference_rays, progress));
    RenderBenchResult result;
    for (const Entrant& entrant : entrants_) result.timings.push_back(entrant.timing);
    turns.report(result);
    return result;
  }

 private:
  Bench(EglContext context,
        calibration::ProjectorProfile profile,
        double texels_per_pixel,
        DrawTarget target,
        UpsamplePass upsample)
      : context_(std::move(context)),
        texels_per_pixel_(texels_per_pixel),
        profile_(std::move(profile)),
        mesh_(frame_filling_mesh(profile_.geometry)),
        target_(std::move(target)),
        upsample_(std::move(upsample)) {}

  // As many repeats as it takes to lay the material side by side.
  [[nodiscard]] Eigen::Vector2d repeats(int width, int height) const {
    return texels_per_pixel_ *
           Eigen::Vector2d(static_cast<double>(profile_.geometry.width) / width,
                           static_cast<double>(profile_.geometry.height) / height);
  }

  Status add(const std::string& name, const btf::ModelShader& shader, Result<DrawPass> pass) {
    if (!pass) return fail_while(fmt::format("timing {}", name), pass.error());
    Entrant& entrant = entrants_.emplace_back();
    entrant.timing = timing_of(name, shader, *pass);
    entrant.pass = std::move(*pass);
    return add_smaller(entrant, entrant.pass->raster());
  }

  // What an entrant draws on, where it is not the whole raster.
  Status add_smaller(Entrant& entrant, const Eigen::Vector2i& raster) {
    if (raster == target_.size()) return {};
    VENEER_ASSIGN(DrawTarget smaller, DrawTarget::create(raster));
    entrant.smaller = std::move(smaller);
    entrant.timing.gpu_bytes += kTargetBytes * static_cast<std::size_t>(raster.prod());
    return {};
  }

  // One for each raster that is smaller.
  Status add_interpolations() {
    std::vector<Eigen::Vector2i> rasters;
    for (const Entrant& entrant : entrants_) {
      if (entrant.smaller && std::ranges::find(rasters, entrant.smaller->size()) == rasters.end())
        rasters.push_back(entrant.smaller->size());
    }
    for (const Eigen::Vector2i& raster : rasters) {
      Entrant& entrant = entrants_.emplace_back();
      entrant.timing.name = fmt::format("interpolation from {}x{}", raster.x(), raster.y());
      VENEER_TRY(add_smaller(entrant, raster));
    }
    return {};
  }

  Status add_compensation(const std::string& name, const calibration::ProjectorProfile& profile) {
    VENEER_ASSIGN(const PreparedProfile prepared, PreparedProfile::prepare(profile, {}));
    VENEER_ASSIGN(CompensatePass compensate, CompensatePass::create(prepared));
    Entrant& entrant = entrants_.emplace_back();
    entrant.timing.name = name;
    entrant.compensate.emplace(std::move(compensate));
    return {};
  }

  static DrawInput input_of(int frame) {
    DrawInput input;
    input.eye_in_world = Vector3d(0.2 * std::sin(0.3 * frame), -0.1, -0.2);
    return input;
  }

  // What the materials draw at some of the timed frames, against the set.
  Status compare(const btf::InterpolatedSet& set, int rays, Progress& progress) {
    const btf::SampleSetInfo& info = set.set().info();
    const auto pixels = static_cast<std::size_t>(profile_.geometry.width) *
                        static_cast<std::size_t>(profile_.geometry.height);
    std::vector<Eigen::Vector4f> drawn(pixels);
    std::vector<ScreenError> errors(entrants_.size());
    progress.start("comparing on the screen", kComparedFrames);
    for (int i = 0; i < kComparedFrames; ++i) {
      const DrawInput input = input_of(kComparedStep * i);
      const std::array<Light, 1> lights{kLight};
      VENEER_ASSIGN(const ProbedScreen screen,
                    probe_screen(mesh_,
                                 input,
                                 lights,
                                 repeats(info.width, info.height),
                                 profile_,
                                 {info.width, info.height, kComparedPixels, rays}));
      const std::vector<Vector3d> reference = reference_at(set, screen.queries);
      for (std::size_t e = 1; e < entrants_.size(); ++e) {
        if (!entrants_[e].pass) continue;
        draw(entrants_[e], input);
        glBindFramebuffer(GL_READ_FRAMEBUFFER, target_.framebuffer());
        glPixelStorei(GL_PACK_ALIGNMENT, 4);
        glPixelStorei(GL_PACK_ROW_LENGTH, 0);
        glReadPixels(0,
                     0,
                     profile_.geometry.width,
                     profile_.geometry.height,
                     GL_RGBA,
                     GL_FLOAT,
                     drawn.data());
        add_error(drawn, screen.queries, reference, errors[e]);
      }
      progress.advance();
    }
    progress.finish();
    for (std::size_t e = 1; e < entrants_.size(); ++e) {
      if (!entrants_[e].pass) continue;
      entrants_[e].timing.screen_epsilon = errors[e].epsilon();
      entrants_[e].timing.screen_rmse = errors[e].rmse();
    }
    return {};
  }

  void draw(const Entrant& entrant, const DrawInput& input) const {
    const DrawTarget& drawn = entrant.smaller ? *entrant.smaller : target_;
    if (entrant.pass) entrant.pass->draw(drawn.framebuffer(), mesh_, input);
    if (entrant.smaller) upsample_.run(drawn, target_);
  }

  void draw(Entrant& entrant, int frame) {
    if (entrant.compensate) {
      entrant.compensate->run(target_.colour(), static_cast<std::uint32_t>(frame));
    } else {
      draw(entrant, input_of(frame));
    }
  }

  // Of a frame of each that is not timed, since it is read back.
  void note_served(int frame) {
    for (Entrant& entrant : entrants_) {
      if (!entrant.pass || entrant.pass->cache() == nullptr) continue;
      draw(entrant, frame);
      entrant.timing.served = mesh_.served();
    }
  }

  EglContext context_;  // first, so that it goes last
  double texels_per_pixel_;
  calibration::ProjectorProfile profile_;
  MeshBuffers mesh_;
  DrawTarget target_;
  UpsamplePass upsample_;
  std::vector<Entrant> entrants_;
};

// Level errors say which by number.
std::string names_of(std::span<const NamedLevel> levels) {
  if (levels.size() == 1) return levels.front().name;
  return fmt::format(
      "levels 0 ({}) to {} ({})", levels.front().name, levels.size() - 1, levels.back().name);
}

Status check_frames(int frames) {
  if (frames < 3 || frames > 10000)
    return fail(Errc::kInvalidOption, "timing: {} frames; 3 to 10000 can be timed", frames);
  return {};
}

}  // namespace

Status RenderBenchOptions::check() const {
  if (std::min(width, height) < 16 || std::max(width, height) > 8192)
    return fail(Errc::kInvalidOption,
                "timing: the size is {} x {}; 16 to 8192 each can be timed",
                width,
                height);
  VENEER_TRY(check_frames(frames));
  if (!(texels_per_pixel >= 1.0 / 16 && texels_per_pixel <= 16.0))
    return fail(Errc::kInvalidOption,
                "timing: {} texels a pixel; 0.0625 to 16 can be drawn",
                texels_per_pixel);
  for (const RenderBenchMaterial& m : materials) {
    if (const Status status = DrawingOptions{.scale = m.scale}.check(); !status)
      return fail_while(fmt::format("timing {}", m.name), status.error());
  }
  if (reference_rays < 1 || reference_rays > 32)
    return fail(Errc::kInvalidOption,
                "timing: {} rays along a pixel's side; 1 to 32 can be compared",
                reference_rays);
  if (reference != nullptr) {
    for (const RenderBenchMaterial& m : materials) {
      const btf::SampleSetInfo& info = reference->set().info();
      VENEER_TRY(btf::refuse_texel_map(
          *m.material, Errc::kInvalidOption, fmt::format("timing {} beside its set", m.name)));
      if (m.material->width() != info.width || m.material->height() != info.height)
        return fail(Errc::kInvalidOption,
                    "timing: {} has {} x {} texels and the set {} x {}; fit it on this set",
                    m.name,
                    m.material->width(),
                    m.material->height(),
                    info.width,
                    info.height);
    }
  }
  return {};
}

Result<RenderBenchResult> bench_render(const RenderBenchOptions& options, Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_ASSIGN(EglContext context, EglContext::create());
  VENEER_ASSIGN(Bench bench, Bench::create(std::move(context), options));
  return bench.run(options, progress);
}

Result<RenderBenchResult> time_scene(const Scene& scene,
                                     const calibration::ProjectorProfile& profile,
                                     std::span<const FrameInput> viewpoints,
                                     std::span<const NamedLevel> levels,
                                     int frames,
                                     Progress& progress) {
  VENEER_TRY(check_frames(frames));
  VENEER_TRY(check_drawable(scene));
  VENEER_TRY(profile.check());
  if (viewpoints.empty())
    return fail(Errc::kInvalidOption, "timing a scene: from no viewpoint; give one or more");
  VENEER_ASSIGN(const EglContext context, EglContext::create());
  const MeshBuffers mesh(scene.mesh);
  RenderBenchResult result;

  const btf::ModelShader textures = plain_textures();
  VENEER_ASSIGN(const DrawTarget target,
                DrawTarget::create({profile.geometry.width, profile.geometry.height}));
  VENEER_ASSIGN(const DrawPass plain,
                DrawPass::create_plain(textures, scene.lights, scene.texture_repeats, profile));
  result.timings.push_back(timing_of("plain", textures, plain));

  std::vector<Level> unnamed;
  unnamed.reserve(levels.size());
  for (const NamedLevel& level : levels) unnamed.push_back(level.level);
  std::optional<LevelDraws> draws;
  if (!levels.empty()) {
    auto made = LevelDraws::create(scene, unnamed, profile);
    if (!made) return fail_while(fmt::format("timing {}", names_of(levels)), made.error());
    draws.emplace(std::move(*made));
  }
  btf::ModelShader shader;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    // Packs all of a material's textures, so once where its levels follow one another.
    if (i == 0 || unnamed[i].material != unnamed[i - 1].material)
      shader = unnamed[i].material->shader();
    result.timings.push_back(timing_of(levels[i].name, shader, draws->pass(i)));
  }

  const auto draw = [&](std::size_t which, int frame) {
    const auto count = static_cast<int>(viewpoints.size());
    FrameInput from = viewpoints[static_cast<std::size_t>(((frame % count) + count) % count)];
    if (which == 0) {
      plain.draw(target.framebuffer(), mesh, {from.eye_in_world, from.world_from_object});
      return;
    }
    from.level = from.next_level = which - 1;
    draws->draw(mesh, from);
  };
  Turns turns(context, result.timings.size());
  turns.run(frames, draw, progress);
  turns.report(result);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (draws->pass(i).cache() == nullptr) continue;
    // Once more from everywhere, since this is read back.
    double served = 0;
    for (std::size_t from = 0; from < viewpoints.size(); ++from) {
      draw(i + 1, static_cast<int>(from));
      served += mesh.served();
    }
    result.timings[i + 1].served = served / static_cast<double>(viewpoints.size());
  }
  return result;
}

}  // namespace veneer::render
