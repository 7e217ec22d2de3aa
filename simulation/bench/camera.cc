// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/camera.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "base/random.h"
#include "simulation/bench/spectrum.h"

namespace veneer::simulation {
namespace {

constexpr double kGrab_s = 0.1;  // from asking to having the picture

/// What the three channels see of a light: 1 for an equal-energy light of 1 cd/m^2.
Rgb32f seen(const Spectrum& light) {
  constexpr std::array kCentres_nm{600.0, 540.0, 460.0};
  constexpr double kWidth_nm = 35;
  Rgb32f rgb;
  for (int c = 0; c < 3; ++c) {
    const Spectrum channel =
        gaussian_spectrum(kCentres_nm.at(static_cast<std::size_t>(c)), kWidth_nm);
    rgb[c] =
        static_cast<float>((channel * light).sum() / channel.sum() * xyz_of(Spectrum::Ones()).y());
  }
  return rgb;
}

/// Normal deviates, symmetric and of deviation 1, to be picked from at random: a picture takes
/// millions of them.
std::vector<float> normal_deviates(std::uint64_t seed) {
  constexpr std::size_t kHalf = 1 << 15;
  Pcg32 random(seed);
  std::vector<double> half(kHalf);
  double squares = 0;
  for (double& value : half) {
    value = random.normal();
    squares += value * value;
  }
  const double scale = 1 / std::sqrt(squares / kHalf);
  std::vector<float> deviates;
  for (const double value : half)
    for (const double sign : {-1.0, 1.0})
      deviates.push_back(static_cast<float>(sign * scale * value));
  return deviates;
}

}  // namespace

Result<std::unique_ptr<VirtualCamera>> VirtualCamera::create(const Bench& bench,
                                                             VirtualPatchDisplay& display) {
  const BenchTruth& truth = bench.truth();
  if (!truth.camera || !truth.board)
    return fail(Errc::kInvalidOption,
                "setting up the bench's camera: the bench has none; give its file [camera] and "
                "[board], as etc/benches/demo.toml does");
  VENEER_ASSIGN(std::vector<RigidTransform> poses,
                simulation::board_poses(*truth.board, *truth.camera, truth.projector));
  return std::unique_ptr<VirtualCamera>(new VirtualCamera(bench, display, std::move(poses)));
}

VirtualCamera::VirtualCamera(const Bench& bench,
                             VirtualPatchDisplay& display,
                             std::vector<RigidTransform> poses)
    : bench_(bench),
      display_(display),
      truth_(*bench.truth().camera),
      board_(*bench.truth().board),
      projector_(bench.truth().projector),
      poses_(std::move(poses)),
      exposure_s_(std::clamp(kFirstExposure_s, truth_.least_exposure_s, truth_.most_exposure_s)),
      deviates_(normal_deviates(truth_.seed)) {
  const ObjectTruth& object = bench.truth().object;
  on_white_ = seen_on(Spectrum::Ones());
  on_object_[0] = seen_on(interpolated_spectrum(object.wavelength_nm, object.reflectance));
  on_object_[1] = on_object_[0];
  if (object.texture != ObjectTruth::Texture::kNone)
    on_object_[1] =
        seen_on(interpolated_spectrum(object.wavelength_nm, object.texture_reflectance));
}

VirtualCamera::SeenLight VirtualCamera::seen_on(const Spectrum& reflectance) const {
  const RoomTruth& room = bench_.truth().room;
  SeenLight light;
  for (int i = 0; i < VirtualProjector::kOutputs; ++i)
    light.outputs.col(i) = seen(reflectance * projector_.primaries()[static_cast<std::size_t>(i)]);
  light.black = seen(reflectance * projector_.black());
  light.ambient = seen(reflectance * planckian_light(room.ambient_kelvin, room.ambient_nits));
  return light;
}

Status VirtualCamera::set_exposure(double seconds) {
  if (!(seconds >= truth_.least_exposure_s && seconds <= truth_.most_exposure_s))
    return fail(Errc::kInvalidOption,
                "setting the exposure of the bench's camera: {} s is not between {} and {} s",
                seconds,
                truth_.least_exposure_s,
                truth_.most_exposure_s);
  exposure_s_ = seconds;
  return {};
}

Status VirtualCamera::place_board(int pose) {
  if (pose < 0 || pose >= static_cast<int>(poses_.size()))
    return fail(Errc::kInvalidOption,
                "placing the board on the bench: there is no pose {}; there are 0 to {}",
                pose,
                poses_.size() - 1);
  place_board(poses_[static_cast<std::size_t>(pose)]);
  return {};
}

void VirtualCamera::place_board(const RigidTransform& world_from_board) {
  view_.emplace(board_, truth_, projector_, bench_.truth().projector, world_from_board);
}

void VirtualCamera::remove_board() { view_.reset(); }

void VirtualCamera::place_object(const RigidTransform& world_from_object) {
  object_.emplace(bench_, truth_, world_from_object);
}

Status VirtualCamera::light_raster(SeenLight& light) const {
  if (!light.raster.empty() && light.lit_picture == display_.shown()) return {};
  const ProjectorTruth& projector = bench_.truth().projector;
  const Image<Rgb16> patch(projector.width, projector.height, display_.code());
  const bool picture = !display_.picture().empty();
  VENEER_ASSIGN(
      light.raster,
      projector_.project(picture ? display_.picture().view() : patch.view(), light.outputs));
  for (Rgb32f& pixel : light.raster.pixels()) pixel += light.black;
  light.lit_picture = display_.shown();
  return {};
}

Result<capture::CameraFrame> VirtualCamera::grab() {
  display_.pass(std::max(kGrab_s, exposure_s_));
  capture::CameraFrame frame;
  frame.counts = Image<Rgb16>(truth_.width, truth_.height);
  frame.full_scale = static_cast<std::uint16_t>((1U << static_cast<unsigned>(truth_.bits)) - 1);
  frame.exposure_s = exposure_s_;
  frame.time = display_.now() - from_seconds(0.5 * exposure_s_);
  Image<Rgb32f> light(truth_.width, truth_.height);  // black where nothing stands
  const auto lamp = static_cast<float>(display_.lamp());
  if (view_) {
    VENEER_TRY(light_raster(on_white_));
    light = view_->gather(on_white_.raster, lamp, on_white_.ambient);
  } else if (object_) {
    ObjectView::OnObject<Image<Rgb32f>> rasters;
    ObjectView::OnObject<Rgb32f> ambient;
    for (std::size_t side = 0; side < 2; ++side) {
      VENEER_TRY(light_raster(on_object_[side]));
      rasters[side] = on_object_[side].raster;
      ambient[side] = on_object_[side].ambient;
    }
    light = object_->gather(rasters, lamp, ambient);
  }

  const auto electrons_per_light = static_cast<float>(truth_.sensitivity * exposure_s_);
  const auto read_variance = static_cast<float>(truth_.read_noise * truth_.read_noise);
  const auto full_scale = static_cast<float>(frame.full_scale);
  const float counts_per_electron = full_scale / static_cast<float>(truth_.full_well);
  const std::uint64_t first_stream = grabs_++ * static_cast<std::uint64_t>(truth_.height);
  const auto width = static_cast<std::size_t>(truth_.width);
  parallel_for(truth_.height, 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto y = static_cast<std::size_t>(begin); y < static_cast<std::size_t>(end); ++y) {
      Pcg32 random(truth_.seed, first_stream + y);
      for (std::size_t pixel = y * width; pixel < (y + 1) * width; ++pixel)
        for (int c = 0; c < 3; ++c) {
          const float electrons = electrons_per_light * light.pixels()[pixel][c];
          const float deviate = deviates_[random.next() >> 16U];
          const float got = electrons + std::sqrt(electrons + read_variance) * deviate;
          frame.counts.pixels()[pixel][static_cast<std::size_t>(c)] = static_cast<std::uint16_t>(
              std::clamp(got * counts_per_electron, 0.0F, full_scale) + 0.5F);
        }
    }
  });
  return frame;
}

}  // namespace veneer::simulation
