// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace veneer::calibration {

/// How the slopes at the knots of a CubicHermite are chosen.
enum class Slopes {
  kSmooth,    ///< of the parabola through three neighbours: second order, may overshoot; the
              ///< curve is linear in the values, so that it does not mind a change of basis
  kMonotone,  ///< the same, limited so that the curve rises and falls only where the data do
};

/// A piecewise cubic through given knots with continuous slope.
/// Source: the limiter is Fritsch and Carlson 1980, "Monotone Piecewise Cubic Interpolation",
/// section 4: slope pairs outside the circle of radius 3 are pulled back onto it.
class CubicHermite {
 public:
  /// @param x  at least two knots, strictly rising (checked).   @param y  one value a knot, finite.
  CubicHermite(std::vector<double> x, std::vector<double> y, Slopes slopes);
  /// The value at `x`; beyond the knots the straight line that leaves the last one.
  [[nodiscard]] double operator()(double x) const;
  /// The derivative at `x`.
  [[nodiscard]] double slope_at(double x) const;

 private:
  std::vector<double> x_;
  std::vector<double> y_;
  std::vector<double> slope_;
};

/// Straight pieces through given knots.
class PiecewiseLinear {
 public:
  /// As CubicHermite.
  PiecewiseLinear(std::vector<double> x, std::vector<double> y);
  /// The value at `x`; beyond the knots the first or last piece goes on.
  [[nodiscard]] double operator()(double x) const;
  /// The slope at `x`; at a knot that of the piece to its right.
  [[nodiscard]] double slope_at(double x) const;

 private:
  [[nodiscard]] std::size_t piece_at(double x) const;
  std::vector<double> x_;
  std::vector<double> y_;
};

/// The rising sequence nearest to `values` in least squares, all with equal weight.
/// Source: pool adjacent violators, Ayer et al. 1955, "An Empirical Distribution Function for
/// Sampling with Incomplete Information".
[[nodiscard]] std::vector<double> nearest_rising(const std::vector<double>& values);

}  // namespace veneer::calibration
