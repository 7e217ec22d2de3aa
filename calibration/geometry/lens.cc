// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/lens.h"

#include <limits>

namespace veneer::geometry {

Eigen::Vector2d Lens::project(const Eigen::Vector3d& point) const {
  if (!(point.z() > 0)) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  const double x = point.x() / point.z();
  const double y = point.y() / point.z();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx,
          fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy};
}

}  // namespace veneer::geometry
