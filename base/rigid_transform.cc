// SPDX-License-Identifier: Apache-2.0
#include "base/rigid_transform.h"

#include <cmath>

namespace veneer {

RigidTransform look_at(const Eigen::Vector3d& eye,
                       const Eigen::Vector3d& target,
                       const Eigen::Vector3d& up) {
  Eigen::Vector3d forward = target - eye;
  forward = forward.norm() > 0 ? forward.normalized() : Eigen::Vector3d::UnitZ().eval();
  Eigen::Vector3d right = forward.cross(up);
  // Looking along `up`: any direction across will do, as long as it is a fixed one.
  if (right.norm() < 1e-9 * up.norm() || up.norm() == 0) {
    right = forward.cross(std::abs(forward.x()) < 0.9 ? Eigen::Vector3d::UnitX()
                                                      : Eigen::Vector3d::UnitY());
  }
  right.normalize();
  Eigen::Matrix3d axes;
  axes << right, forward.cross(right), forward;
  return {Eigen::Quaterniond(axes), eye};
}

}  // namespace veneer
