// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include <array>

#include "base/rigid_transform.h"

namespace veneer::geometry {

/// A pose as a fit's unknowns: rotation vector, translation.
using PoseBlock = std::array<double, 6>;

[[nodiscard]] inline PoseBlock block_of(const RigidTransform& pose) {
  const Eigen::AngleAxisd turn(pose.rotation);
  const Eigen::Vector3d rotation = turn.angle() * turn.axis();
  const Eigen::Vector3d& t = pose.translation;
  return {rotation.x(), rotation.y(), rotation.z(), t.x(), t.y(), t.z()};
}

[[nodiscard]] inline RigidTransform pose_of(const PoseBlock& b) {
  const Eigen::Vector3d rotation(b[0], b[1], b[2]);
  const double angle = rotation.norm();
  RigidTransform pose;
  if (angle > 0) pose.rotation = Eigen::AngleAxisd(angle, rotation / angle);
  pose.translation = {b[3], b[4], b[5]};
  return pose;
}

}  // namespace veneer::geometry
