// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

namespace veneer {

/// A pose `b_from_a`: takes points and directions of frame a into frame b. Metres, right-handed.
/// Names cancel: c_from_a = c_from_b * b_from_a.
struct RigidTransform {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return rotation * point + translation;
  }
  [[nodiscard]] RigidTransform operator*(const RigidTransform& b_from_a) const {
    return {(rotation * b_from_a.rotation).normalized(),
            rotation * b_from_a.translation + translation};
  }
  [[nodiscard]] RigidTransform inverse() const {
    const Eigen::Quaterniond inverse_rotation = rotation.conjugate();
    return {inverse_rotation, -(inverse_rotation * translation)};
  }
  [[nodiscard]] Eigen::Matrix4d matrix() const {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner<3, 3>() = rotation.toRotationMatrix();
    m.topRightCorner<3, 1>() = translation;
    return m;
  }
};

/// The pose `world_from_device` of a projector or camera at `eye` that looks at `target`, in the
/// convention of both: +z forward, x right, y down.
/// @param up  any direction not parallel to the line of sight; where it is, another is chosen.
[[nodiscard]] RigidTransform look_at(const Eigen::Vector3d& eye,
                                     const Eigen::Vector3d& target,
                                     const Eigen::Vector3d& up);

}  // namespace veneer
