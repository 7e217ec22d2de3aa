// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

// Periodic noise for the synthetic materials. A place (x, y) is in tile widths; everything repeats
// with the tile.

namespace veneer::simulation {

/// A number in [0, 1) that belongs to a lattice point.
[[nodiscard]] double lattice_random(int column, int row, std::uint64_t seed);

/// Smooth noise in [-1, 1] on a lattice of `period_x` by `period_y` points a tile (both > 0).
[[nodiscard]] double smooth_noise(
    double x, double y, int period_x, int period_y, std::uint64_t seed);

/// Octaves of smooth_noise, each of twice the frequency and half the height; within [-2, 2].
[[nodiscard]] double cloud_noise(double x, double y, int period, int octaves, std::uint64_t seed);

/// Distances from a place to scattered points, in lattice steps.
struct CellDistances {
  double nearest{};
  double second{};
  double smooth_square{};  ///< of the nearest, rounded where two are equally near
  double random{};         ///< in [0, 1), of the nearest point
};

/// One point in each of `count` x `count` squares a tile, moved off its middle by up to half of
/// `jitter` squares. Source: Worley 1996, "A Cellular Texture Basis Function".
/// @param rounding  over which difference of squares smooth_square rounds, > 0
[[nodiscard]] CellDistances cell_distances(
    double x, double y, int count, double jitter, double rounding, std::uint64_t seed);

/// 0 below `low`, 1 above `high`, smooth between.
[[nodiscard]] double smooth_step(double low, double high, double value);

}  // namespace veneer::simulation
