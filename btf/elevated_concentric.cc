// SPDX-License-Identifier: Apache-2.0
#include "btf/elevated_concentric.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace veneer::btf {
namespace {

constexpr double kQuarterPi = std::numbers::pi / 4.0;

}  // namespace

Direction direction_from_square(const Eigen::Vector2d& st) {
  const double a = 2.0 * std::clamp(st.x(), 0.0, 1.0) - 1.0;
  const double b = 2.0 * std::clamp(st.y(), 0.0, 1.0) - 1.0;
  if (a == 0.0 && b == 0.0) return Direction::UnitZ();
  // Squares around the centre become circles; rho keeps the sign of the longer coordinate, so that
  // one formula serves two opposite quadrants.
  double rho = a;
  double phi = 0.0;
  if (std::abs(a) > std::abs(b)) {
    phi = kQuarterPi * (b / a);
  } else {
    rho = b;
    phi = 2.0 * kQuarterPi - kQuarterPi * (a / b);
  }
  // Elevated so that rho^2, and with it the disc's area, is linear in z: sin(theta)^2 = 1 - z^2.
  const double rho2 = rho * rho;
  const double sin_theta = rho * std::sqrt(2.0 - rho2);
  return {sin_theta * std::cos(phi), sin_theta * std::sin(phi), 1.0 - rho2};
}

Eigen::Vector2d square_from_direction(const Direction& direction) {
  const double x = direction.x();
  const double y = direction.y();
  const double in_plane2 = x * x + y * y;
  // rho^2 = 1 - z, written without cancellation near the normal.
  const double rho = direction.z() > 0.0 ? std::sqrt(in_plane2 / (1.0 + direction.z())) : 1.0;
  const double radius = std::min(rho, 1.0);
  double a = radius;
  double b = 0.0;
  if (std::abs(x) > std::abs(y)) {
    a = std::copysign(radius, x);
    b = a * std::atan(y / x) / kQuarterPi;
  } else if (y != 0.0) {
    b = std::copysign(radius, y);
    a = b * std::atan(x / y) / kQuarterPi;
  }  // else straight down: the horizon at azimuth 0, as angles_from_direction has it
  return {0.5 * (a + 1.0), 0.5 * (b + 1.0)};
}

}  // namespace veneer::btf
