// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/internal_noise.h"

#include <algorithm>
#include <cmath>

namespace veneer::simulation {

namespace {

int wrapped(int index, int period) { return ((index % period) + period) % period; }

}  // namespace

double lattice_random(int column, int row, std::uint64_t seed) {
  // Neighbouring points must have nothing in common, so every bit is mixed into every other.
  // Source: Steele, Lea, Flood 2014, "Fast Splittable Pseudorandom Number Generators", mix64.
  const auto mixed = [](std::uint64_t z) {
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31U);
  };
  const std::uint64_t point =
      (static_cast<std::uint64_t>(static_cast<std::uint32_t>(column)) << 32U) |
      static_cast<std::uint32_t>(row);
  return static_cast<double>(mixed(mixed(seed + 0x9E3779B97F4A7C15ULL) ^ point) >> 11U) * 0x1p-53;
}

double smooth_step(double low, double high, double value) {
  const double t = std::clamp((value - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

double smooth_noise(double x, double y, int period_x, int period_y, std::uint64_t seed) {
  const double left = std::floor(x * period_x);
  const double up = std::floor(y * period_y);
  const double fx = smooth_step(0.0, 1.0, x * period_x - left);
  const double fy = smooth_step(0.0, 1.0, y * period_y - up);
  const auto at = [&](int dx, int dy) {
    return lattice_random(wrapped(static_cast<int>(left) + dx, period_x),
                          wrapped(static_cast<int>(up) + dy, period_y),
                          seed);
  };
  return 2.0 * std::lerp(std::lerp(at(0, 0), at(1, 0), fx), std::lerp(at(0, 1), at(1, 1), fx), fy) -
         1.0;
}

double cloud_noise(double x, double y, int period, int octaves, std::uint64_t seed) {
  double sum = 0.0;
  double height = 1.0;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += height *
           smooth_noise(
               x, y, period << octave, period << octave, seed + static_cast<std::uint64_t>(octave));
    height *= 0.5;
  }
  return sum;
}

CellDistances cell_distances(
    double x, double y, int count, double jitter, double rounding, std::uint64_t seed) {
  const auto column = static_cast<int>(std::floor(x * count));
  const auto row = static_cast<int>(std::floor(y * count));
  CellDistances result{1e9, 1e9, 0.0, 0.0};
  double soft_sum = 0.0;
  for (int r = row - 2; r <= row + 2; ++r) {
    for (int c = column - 2; c <= column + 2; ++c) {
      const int home_column = wrapped(c, count);
      const int home_row = wrapped(r, count);
      const double dx =
          c + 0.5 + jitter * (lattice_random(home_column, home_row, seed) - 0.5) - x * count;
      const double dy =
          r + 0.5 + jitter * (lattice_random(home_column, home_row, seed + 1) - 0.5) - y * count;
      const double square = dx * dx + dy * dy;
      soft_sum += std::exp(-square / rounding);
      const double distance = std::sqrt(square);
      if (distance < result.nearest) {
        result.second = result.nearest;
        result.nearest = distance;
        result.random = lattice_random(home_column, home_row, seed + 2);
      } else {
        result.second = std::min(result.second, distance);
      }
    }
  }
  // Minus the logarithm of a sum of exponentials: the smooth minimum of the squares.
  result.smooth_square = -rounding * std::log(soft_sum);
  return result;
}

}  // namespace veneer::simulation
