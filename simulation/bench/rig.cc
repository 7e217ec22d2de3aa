// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/rig.h"

#include <algorithm>
#include <utility>

#include "base/units.h"

namespace veneer::simulation {

std::vector<Landmark> landmarks_of(const Mesh& mesh) {
  struct Way {
    const char* name;
    Eigen::Vector3d direction;
  };
  // From in front, with +y up and +x to the right.
  static const std::array<Way, 14> kWays{{{"topmost point", {0, 1, 0}},
                                          {"bottommost point", {0, -1, 0}},
                                          {"leftmost point", {-1, 0, 0}},
                                          {"rightmost point", {1, 0, 0}},
                                          {"foremost point", {0, 0, 1}},
                                          {"rearmost point", {0, 0, -1}},
                                          {"upper left front", {-1, 1, 1}},
                                          {"upper right front", {1, 1, 1}},
                                          {"lower left front", {-1, -1, 1}},
                                          {"lower right front", {1, -1, 1}},
                                          {"upper left back", {-1, 1, -1}},
                                          {"upper right back", {1, 1, -1}},
                                          {"lower left back", {-1, -1, -1}},
                                          {"lower right back", {1, -1, -1}}}};
  std::vector<Landmark> landmarks;
  if (mesh.positions.empty()) return landmarks;
  for (const Way& way : kWays) {
    const auto point = std::ranges::max_element(
        mesh.positions, {}, [&way](const Eigen::Vector3d& x) { return x.dot(way.direction); });
    const bool known = std::ranges::any_of(
        landmarks, [&point](const Landmark& other) { return other.in_object == *point; });
    if (!known) landmarks.push_back({way.name, *point});
  }
  return landmarks;
}

Result<std::unique_ptr<VirtualRig>> VirtualRig::create(const Bench& bench) {
  std::unique_ptr<VirtualRig> rig(new VirtualRig(bench));
  VENEER_ASSIGN(rig->camera_, VirtualCamera::create(bench, rig->display_));
  return rig;
}

VirtualRig::VirtualRig(const Bench& bench)
    : bench_(bench),
      display_(bench),
      colorimeter_(bench, display_, options_from(bench.truth().instrument)),
      landmarks_(landmarks_of(bench.mesh())),
      random_(bench.truth().tracker.seed) {}

int VirtualRig::board_columns() const { return bench_.truth().board->columns; }
int VirtualRig::board_rows() const { return bench_.truth().board->rows; }
double VirtualRig::board_square_m() const { return bench_.truth().board->square_m; }
int VirtualRig::board_poses() const { return static_cast<int>(camera_->board_poses().size()); }

Status VirtualRig::place_board(int pose) {
  VENEER_TRY(camera_->place_board(pose));
  pose_ = pose;
  return {};
}

void VirtualRig::remove_board() {
  camera_->remove_board();
  pose_ = -1;
}

Eigen::Vector3d VirtualRig::noise(double deviation) {
  const double x = random_.normal();
  const double y = random_.normal();
  const double z = random_.normal();
  return deviation * Eigen::Vector3d(x, y, z);
}

Result<tracking::SynchronisedPose> VirtualRig::board_sensor() {
  if (pose_ < 0)
    return fail(
        Errc::kInvalidOption,
        "asking for the board's sensor on the bench: no board stands there; place it first");
  const TrackerTruth& tracker = bench_.truth().tracker;
  tracking::SynchronisedPose sensor;
  sensor.position_deviation_m = tracker.position_noise_m;
  sensor.rotation_deviation_rad = to_radians(Degrees{tracker.rotation_noise_deg}).value;
  sensor.samples = 1;
  sensor.world_from_body = camera_->board_poses()[static_cast<std::size_t>(pose_)] *
                           bench_.truth().board->board_from_sensor;
  sensor.world_from_body.translation += noise(sensor.position_deviation_m);
  const Eigen::Vector3d turn = noise(sensor.rotation_deviation_rad);
  if (const double angle = turn.norm(); angle > 0)
    sensor.world_from_body.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) *
                                      sensor.world_from_body.rotation;
  return sensor;
}

Eigen::Vector3d VirtualRig::touch(const Eigen::Vector3d& x_in_object) {
  return x_in_object + noise(touch_deviation_m());
}

Result<Eigen::Vector3d> VirtualRig::touch_spot(const Eigen::Vector2d& pixel) {
  const auto x_in_world = bench_.lit_point({}, pixel);
  if (!x_in_world)
    return fail(Errc::kInvalidOption,
                "touching the spot of raster position {}, {} on the bench: it does not fall on the "
                "object; show another",
                pixel.x(),
                pixel.y());
  return Eigen::Vector3d(*x_in_world + noise(touch_deviation_m()));
}

double VirtualRig::touch_deviation_m() const { return bench_.truth().tracker.position_noise_m; }

}  // namespace veneer::simulation
