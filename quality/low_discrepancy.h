// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to quality/.

#include <array>
#include <cmath>
#include <cstddef>

namespace veneer::quality {

/// Points that fill the unit cube of `kDimensions` evenly however many are taken, the same each
/// time: additive recurrences on powers of the root of x^(d + 1) = x + 1 (Roberts 2018, "The
/// Unreasonable Effectiveness of Quasirandom Sequences").
template <std::size_t kDimensions>
class LowDiscrepancy {
 public:
  LowDiscrepancy() {
    double root = 2.0;
    // x = (1 + x)^(1 / (d + 1)) contracts; it has settled long before this.
    for (int i = 0; i < 64; ++i)
      root = std::pow(1.0 + root, 1.0 / static_cast<double>(kDimensions + 1));
    double step = 1.0;
    for (double& s : step_) s = step /= root;
  }
  [[nodiscard]] std::array<double, kDimensions> operator()(std::size_t index) const {
    std::array<double, kDimensions> point;
    for (std::size_t i = 0; i < kDimensions; ++i) {
      const double x = 0.5 + static_cast<double>(index) * step_[i];
      point[i] = x - std::floor(x);
    }
    return point;
  }

 private:
  std::array<double, kDimensions> step_{};
};

}  // namespace veneer::quality
