// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated/pose_noise.h"

#include "base/units.h"

namespace veneer::tracking {
namespace {

Eigen::Vector3d normal_vector(Pcg32& random, double sigma) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return sigma * Eigen::Vector3d(x, y, z);
}

void read(TomlReader& toml, std::string_view key, double& value, double most) {
  toml.read(key, value);
  if (!(value >= 0 && value <= most)) {
    toml.add_error(key, fmt::format("{} is outside 0 to {}", value, most));
  }
}

}  // namespace

PoseNoise PoseNoise::read(TomlReader& toml) {
  PoseNoise noise;
  tracking::read(toml, "noise_position_mm", noise.position_mm, 1000);
  tracking::read(toml, "noise_rotation_deg", noise.rotation_deg, 90);
  return noise;
}

RigidTransform PoseNoise::added_to(const RigidTransform& truth, Pcg32& random) const {
  const Eigen::Vector3d shift = normal_vector(random, position_mm * 1e-3);
  const Eigen::Vector3d turn = normal_vector(random, to_radians(Degrees{rotation_deg}).value);
  RigidTransform measured = truth;
  measured.translation += shift;
  const double angle_rad = turn.norm();
  if (angle_rad > 0)
    measured.rotation *= Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, turn / angle_rad));
  return measured;
}

}  // namespace veneer::tracking
