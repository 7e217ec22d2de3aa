// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "btf/direction.h"

namespace veneer::btf {

/// Where `c` lies of the great circle from `a` to `b`: > 0 to its left as seen from outside the
/// sphere, < 0 to its right, 0 on it within rounding. The magnitude means nothing.
[[nodiscard]] double side_of_arc(const Direction& a, const Direction& b, const Direction& c);

/// Delaunay triangulation of directions in the upper hemisphere: great-circle triangles,
/// counter-clockwise seen from outside, that cover the spherical convex hull, and whose
/// circumcircles hold no further direction. Empty where all lie on one great circle.
///
/// Directions on a common circle, such as a measured ring, have many such triangulations; within
/// rounding the diagonals of the sweep are kept, so the result depends on the input alone.
/// Cost: O(n^2) at worst. @param directions  unit, z >= 0 within rounding, no two equal.
[[nodiscard]] std::vector<std::array<int, 3>> triangulate_directions(
    const DirectionSet& directions);

}  // namespace veneer::btf
