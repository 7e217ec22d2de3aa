// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "base/result.h"

namespace veneer::btf {

/// Unit vector in a surface point's local frame, pointing away from the surface: z along the
/// normal, x along the tangent (growing texel column), y = z cross x (towards smaller texel rows).
using Direction = Eigen::Vector3d;

/// Polar coordinates of a direction, radians: theta from the normal, phi from the tangent in
/// [0, 2 pi). phi of the normal itself is 0.
struct Angles {
  double theta{};
  double phi{};
};

[[nodiscard]] Direction direction_from_angles(const Angles& angles);
/// @param direction  need not be of unit length; zero or non-finite gives {0, 0}.
[[nodiscard]] Angles angles_from_direction(const Direction& direction);

/// The directions in which a sample was seen or lit, in the order of the sample's data.
using DirectionSet = std::vector<Direction>;

/// The 81 directions of the Bonn measurements (Sattler, Sarlette, Klein 2003): theta 0, 15, ... 75
/// degrees with 1, 6, 12, 18, 20, 24 azimuths that start at 0.
[[nodiscard]] DirectionSet bonn_directions();

/// The 151 directions of the UBO2014 measurements (Weinmann, Gall, Klein 2014): theta 0, 11, 23.5,
/// 30, 37.5, ... 75 degrees with 1, 6, 12, 12, 12, 18, 18, 24, 24, 24 azimuths, some rings turned
/// by half a step of 30 or 15 degrees.
[[nodiscard]] DirectionSet ubo2014_directions();

/// Directions nearer than this chord count as equal: far below what any measuring
/// device resolves, far enough apart for triangles in double precision.
inline constexpr double kEqualDirections = 1e-6;

/// The first two entries (lower index first) that are equal within kEqualDirections, if any.
[[nodiscard]] std::optional<std::pair<int, int>> find_equal_directions(
    const DirectionSet& directions);

/// "theta,phi" in degrees under a header line. Errors: kNotFound, kBadFormat (names the line; theta
/// must lie in [0, 90]).
[[nodiscard]] Result<DirectionSet> read_directions(const std::filesystem::path& csv);
[[nodiscard]] Status write_directions(const std::filesystem::path& csv,
                                      const DirectionSet& directions);

}  // namespace veneer::btf
