// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/direction.h"

namespace veneer::btf {

/// Schneider's elevated concentric map from the unit square to the upper hemisphere:
/// area-preserving, continuous, invertible. The square's centre is the normal, its border the
/// horizon. Source: Schneider 2004, "Real-time BTF Rendering", section 6.1 (concentric map of
/// Shirley and Chiu 1997, then z = 1 - rho^2).
/// @param st  in [0, 1]^2; clamped to it.
[[nodiscard]] Direction direction_from_square(const Eigen::Vector2d& st);

/// The inverse. @param direction  unit; below the horizon it is taken to the horizon at its
/// azimuth.
[[nodiscard]] Eigen::Vector2d square_from_direction(const Direction& direction);

}  // namespace veneer::btf
