// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/cube_model.h"

#include <cmath>

namespace veneer::calibration {

Xyz CubeModel::forward(const Eigen::Vector3d& drive) const {
  if (drive.hasNaN()) return Xyz::Constant(std::nan(""));
  const Eigen::Vector3d nearest = drive.cwiseMax(0.0).cwiseMin(1.0);
  if (nearest == drive) return inside(drive);
  return inside(nearest) + slope_inside(nearest) * (drive - nearest);
}

Eigen::Matrix3d CubeModel::jacobian(const Eigen::Vector3d& drive) const {
  if (drive.hasNaN()) return Eigen::Matrix3d::Constant(std::nan(""));
  return slope_inside(drive.cwiseMax(0.0).cwiseMin(1.0));
}

}  // namespace veneer::calibration
