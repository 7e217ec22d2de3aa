// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/studio.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "base/random.h"
#include "simulation/studio/board_picture.h"
#include "simulation/studio/camera.h"
#include "simulation/studio/geometry.h"
#include "simulation/studio/hands.h"
#include "simulation/studio/jones.h"
#include "simulation/studio/polariser.h"
#include "simulation/studio/rig.h"
#include "simulation/studio/scene.h"
#include "simulation/studio/traced_sample.h"

namespace veneer::simulation {
namespace {

constexpr std::uint64_t kAimStream = 4;
// About 3 degrees: a light that would end up lower stays where it was planned.
constexpr double kLeastElevation = 0.05;

/// Lights as they stand, a little off what was aimed at.
std::vector<Eigen::Vector3d> aimed(const btf::DirectionSet& planned, const StudioTruth& truth) {
  Pcg32 random(truth.seed, kAimStream);
  const double deviation = truth.light_aim_error_deg * std::numbers::pi / 180;
  std::vector<Eigen::Vector3d> lights;
  for (const btf::Direction& direction : planned) {
    const Eigen::Vector3d wanted = direction.normalized();
    Eigen::Index least = 0;
    wanted.cwiseAbs().minCoeff(&least);
    const Eigen::Vector3d x = studio::across_ray(Eigen::Vector3d::Unit(least), wanted);
    const Eigen::Vector3d off =
        deviation * random.normal() * x + deviation * random.normal() * wanted.cross(x);
    const Eigen::Vector3d light = (wanted + off).normalized();
    lights.push_back(light.z() >= std::min(kLeastElevation, wanted.z()) ? light : wanted);
  }
  return lights;
}

}  // namespace

struct VirtualStudio::State {
  State(studio::StudioScene scene, const StudioTruth& truth, const capture::CapturePlan& the_plan)
      : plan(the_plan),
        rig(std::move(scene),
            truth,
            static_cast<int>(the_plan.views.size()),
            static_cast<int>(the_plan.lights.size()),
            the_plan.mirror_light.has_value()),
        camera(rig),
        hands(rig),
        polariser(rig) {}
  capture::CapturePlan plan;
  studio::StudioRig rig;
  studio::StudioCamera camera;
  studio::StudioHands hands;
  studio::StudioPolariser polariser;
};

VirtualStudio::VirtualStudio(std::unique_ptr<State> state) : state_(std::move(state)) {}
VirtualStudio::~VirtualStudio() = default;

Result<std::unique_ptr<VirtualStudio>> VirtualStudio::create(const StudioTruth& truth,
                                                             const capture::CapturePlan& plan,
                                                             const std::filesystem::path& cache,
                                                             Progress& progress) {
  if (const Status valid = truth.check(); !valid)
    return fail_while("setting up the studio", valid.error());
  VENEER_ASSIGN(studio::StudioGeometry geometry, studio::StudioGeometry::create(truth, plan));
  VENEER_ASSIGN(studio::BoardPicture board, studio::BoardPicture::draw(plan.board));
  const std::vector<Eigen::Vector3d> lights = aimed(plan.lights, truth);
  const double tile_mm = truth.tile_mm > 0 ? truth.tile_mm : plan.area.width_mm;
  const double texels = tile_mm / plan.area.width_mm * plan.area.columns;
  const int size = static_cast<int>(std::lround(std::min(texels, 1e6)));
  VENEER_ASSIGN(studio::TracedSample sample,
                studio::TracedSample::trace(truth, size, plan.views, lights, cache, progress));
  studio::StudioScene scene(
      truth, plan, std::move(geometry), std::move(board), std::move(sample), lights);
  return std::unique_ptr<VirtualStudio>(
      new VirtualStudio(std::make_unique<State>(std::move(scene), truth, plan)));
}

capture::Camera& VirtualStudio::camera() { return state_->camera; }
capture::Polariser* VirtualStudio::polariser() {
  return state_->rig.truth().mosaic ? nullptr : &state_->polariser;
}
capture::Hands& VirtualStudio::hands() { return state_->hands; }
Clock& VirtualStudio::clock() { return state_->rig.clock(); }

VirtualStudio::TexelTruth VirtualStudio::truth(int view, int light) const {
  const capture::SampleArea& area = state_->plan.area;
  const Eigen::Vector3d to_light = light_direction(light);
  const studio::Beam sent = studio::polarised_beam(
      to_light, state_->plan.polarisation.axis, std::numeric_limits<double>::infinity());
  const auto gain = static_cast<float>(studio::power(
      studio::reflected_by_dielectric(sent,
                                      to_light,
                                      state_->plan.views[static_cast<std::size_t>(view)],
                                      state_->rig.truth().index)));
  TexelTruth truth;
  for (auto* const image : {&truth.specular, &truth.diffuse, &truth.unpolarised_specular})
    *image = Image<Rgb32f>(area.columns, area.rows);
  for (int row = 0; row < area.rows; ++row)
    for (int column = 0; column < area.columns; ++column) {
      const auto texel = state_->rig.scene().sample().texel(view, light, column, row);
      truth.specular(column, row) = gain * texel.specular;
      truth.diffuse(column, row) = texel.diffuse;
      truth.unpolarised_specular(column, row) = texel.specular;
    }
  return truth;
}

Eigen::Vector3d VirtualStudio::light_direction(int light) const {
  return state_->rig.scene().lights()[static_cast<std::size_t>(light)];
}

capture::CameraLens VirtualStudio::lens() const { return state_->rig.scene().geometry().lens(); }

RigidTransform VirtualStudio::camera_from_board(int view) const {
  constexpr double kMetre = 1e-3;  // of a millimetre
  const studio::StudioGeometry& geometry = state_->rig.scene().geometry();
  RigidTransform pose = geometry.local_from_camera(view).inverse() * geometry.local_from_board();
  pose.translation *= kMetre;
  return pose;
}

Image<Rgb32f> VirtualStudio::light() { return state_->rig.light(); }

}  // namespace veneer::simulation
