// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/lens.h"

#include <limits>

#include "calibration/geometry/internal_projection.h"

namespace veneer::geometry {

Eigen::Vector2d Lens::project(const Eigen::Vector3d& point) const {
  const std::array<double, 9> values = coefficients();
  Eigen::Vector2d pixel = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (!project_with(values.data(), point.data(), pixel.data()))
    pixel.setConstant(std::numeric_limits<double>::quiet_NaN());
  return pixel;
}

}  // namespace veneer::geometry
