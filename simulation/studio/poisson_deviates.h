// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "base/random.h"

namespace veneer::simulation::studio {

/// Whole electrons of a small mean.
class PoissonDeviates {
 public:
  static constexpr int kMost = 30;  ///< electrons; above, a normal deviate does
  PoissonDeviates();
  /// @param mean  at most kMost; 0 or less, or NaN, gives none.
  [[nodiscard]] int draw(double mean, Pcg32& random) const;

 private:
  // Of every whole mean up to kMost: the chances of at most 0, 1, ... electrons.
  std::array<std::vector<double>, kMost + 1> cumulative_;
};

}  // namespace veneer::simulation::studio
