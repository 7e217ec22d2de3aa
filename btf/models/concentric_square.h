// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/direction.h"

namespace veneer::btf {

/// square_from_direction (elevated_concentric.h) as the shaders compute it, in
/// elevated_concentric.glsl: without branches, with a polynomial for the arc tangent.
///
/// Differs from the exact map by at most kConcentricSquareError; continuous, and equal to it on the
/// axes and diagonals of the square. Grids are filled with this map, so that the difference moves
/// nodes a little but costs no accuracy.
/// @param direction  unit; below the horizon as on it.
[[nodiscard]] Eigen::Vector2d concentric_square(const Direction& direction);

/// Largest difference of a coordinate from the exact map, in the unit square.
inline constexpr double kConcentricSquareError = 5e-4;

}  // namespace veneer::btf
