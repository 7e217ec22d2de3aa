// SPDX-License-Identifier: Apache-2.0
#include "btf/models/concentric_square.h"

#include <algorithm>
#include <cmath>

namespace veneer::btf {

Eigen::Vector2d concentric_square(const Direction& direction) {
  const double x = std::abs(direction.x());
  const double y = std::abs(direction.y());
  const double t = std::min(x, y) / std::max({x, y, 1e-12});
  // atan(t) * 4 / pi on [0, 1]: minimax with its sum fixed to 1, so that octants meet; error 9e-4.
  const double u = t * t;
  const double minor = t * (1.2665755 + u * (-0.3634261 + u * 0.0968506));
  const double rho = 0.5 * std::sqrt(std::clamp(1.0 - direction.z(), 0.0, 1.0));
  const double a = rho * (x >= y ? 1.0 : minor);
  const double b = rho * (x >= y ? minor : 1.0);
  return {0.5 + (direction.x() < 0.0 ? -a : a), 0.5 + (direction.y() < 0.0 ? -b : b)};
}

}  // namespace veneer::btf
