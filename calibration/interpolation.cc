// SPDX-License-Identifier: Apache-2.0
#include "calibration/interpolation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/result.h"

namespace veneer::calibration {
namespace {

double secant(const std::vector<double>& x, const std::vector<double>& y, std::size_t i) {
  return (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
}

std::vector<double> parabolic_slopes(const std::vector<double>& x, const std::vector<double>& y) {
  const std::size_t n = x.size();
  if (n == 2) return {secant(x, y, 0), secant(x, y, 0)};
  std::vector<double> slopes(n);
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double before = x[i] - x[i - 1];
    const double after = x[i + 1] - x[i];
    slopes[i] = (after * secant(x, y, i - 1) + before * secant(x, y, i)) / (before + after);
  }
  slopes[0] = 2.0 * secant(x, y, 0) - slopes[1];
  slopes[n - 1] = 2.0 * secant(x, y, n - 2) - slopes[n - 2];
  return slopes;
}

void limit_slopes(const std::vector<double>& x,
                  const std::vector<double>& y,
                  std::vector<double>& slopes) {
  constexpr double kRadius = 3.0;
  for (std::size_t i = 0; i + 1 < x.size(); ++i) {
    const double rise = secant(x, y, i);
    // A slope against the data's direction (or next to a flat piece) becomes flat.
    if (slopes[i] * rise <= 0.0) slopes[i] = 0.0;
    if (slopes[i + 1] * rise <= 0.0) slopes[i + 1] = 0.0;
    const double length = std::hypot(slopes[i], slopes[i + 1]);
    if (length > kRadius * std::abs(rise)) {
      const double shrink = kRadius * std::abs(rise) / length;
      slopes[i] *= shrink;
      slopes[i + 1] *= shrink;
    }
  }
}

}  // namespace

CubicHermite::CubicHermite(std::vector<double> x, std::vector<double> y, Slopes slopes)
    : x_(std::move(x)), y_(std::move(y)) {
  VENEER_CHECK(x_.size() >= 2 && x_.size() == y_.size());
  VENEER_CHECK(std::ranges::adjacent_find(x_, std::ranges::greater_equal{}) == x_.end());
  slope_ = parabolic_slopes(x_, y_);
  if (slopes == Slopes::kMonotone) limit_slopes(x_, y_, slope_);
}

double CubicHermite::operator()(double x) const {
  if (x <= x_.front()) return y_.front() + slope_.front() * (x - x_.front());
  if (x >= x_.back()) return y_.back() + slope_.back() * (x - x_.back());
  const auto after = static_cast<std::size_t>(std::ranges::upper_bound(x_, x) - x_.begin());
  const std::size_t i = after - 1;
  const double width = x_[after] - x_[i];
  const double t = (x - x_[i]) / width;
  const double s = 1.0 - t;
  return s * s * ((1.0 + 2.0 * t) * y_[i] + t * width * slope_[i]) +
         t * t * ((1.0 + 2.0 * s) * y_[after] - s * width * slope_[after]);
}

double CubicHermite::slope_at(double x) const {
  if (x <= x_.front()) return slope_.front();
  if (x >= x_.back()) return slope_.back();
  const auto after = static_cast<std::size_t>(std::ranges::upper_bound(x_, x) - x_.begin());
  const std::size_t i = after - 1;
  const double width = x_[after] - x_[i];
  const double t = (x - x_[i]) / width;
  const double s = 1.0 - t;
  return 6.0 * s * t * (y_[after] - y_[i]) / width + s * (1.0 - 3.0 * t) * slope_[i] +
         t * (3.0 * t - 2.0) * slope_[after];
}

PiecewiseLinear::PiecewiseLinear(std::vector<double> x, std::vector<double> y)
    : x_(std::move(x)), y_(std::move(y)) {
  VENEER_CHECK(x_.size() >= 2 && x_.size() == y_.size());
  VENEER_CHECK(std::ranges::adjacent_find(x_, std::ranges::greater_equal{}) == x_.end());
}

std::size_t PiecewiseLinear::piece_at(double x) const {
  const auto after = static_cast<std::size_t>(std::ranges::upper_bound(x_, x) - x_.begin());
  return std::clamp<std::size_t>(after, 1, x_.size() - 1) - 1;
}

double PiecewiseLinear::operator()(double x) const {
  const std::size_t i = piece_at(x);
  return y_[i] + secant(x_, y_, i) * (x - x_[i]);
}

double PiecewiseLinear::slope_at(double x) const { return secant(x_, y_, piece_at(x)); }

std::vector<double> nearest_rising(const std::vector<double>& values) {
  struct Pool {
    double sum;
    std::size_t count;
    [[nodiscard]] double mean() const { return sum / static_cast<double>(count); }
  };
  std::vector<Pool> pools;
  for (const double value : values) {
    pools.push_back({value, 1});
    while (pools.size() > 1 && pools[pools.size() - 2].mean() > pools.back().mean()) {
      const Pool last = pools.back();
      pools.pop_back();
      pools.back().sum += last.sum;
      pools.back().count += last.count;
    }
  }
  std::vector<double> rising;
  rising.reserve(values.size());
  for (const Pool& pool : pools) rising.insert(rising.end(), pool.count, pool.mean());
  return rising;
}

}  // namespace veneer::calibration
