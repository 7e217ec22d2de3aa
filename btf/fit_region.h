// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "base/result.h"
#include "btf/sample_set.h"

namespace veneer::btf {

/// How much the samples of each (view, light) pair matter to a fit, >= 0: errors are squared and
/// multiplied by this. All 1 where nobody says.
struct PairWeights {
  std::vector<float> weight;  ///< [view][light], pair_count() of the set

  /// Errors: kInvalidOption (another number of pairs, values that are negative or no numbers, all
  /// zero).
  [[nodiscard]] Status check(const SampleSetInfo& info) const;
};

/// The part of the hemisphere that directions of one kind keep to: a box on the square of the
/// elevated concentric map (CONVENTIONS.md), [0, 1] each way. All of it where nobody says.
struct DirectionBox {
  double u_min = 0, u_max = 1;
  double v_min = 0, v_max = 1;
  [[nodiscard]] bool is_all() const { return u_min <= 0 && u_max >= 1 && v_min <= 0 && v_max >= 1; }
  /// Errors: kInvalidOption, naming `what`, where it is no box on the square.
  [[nodiscard]] Status check(std::string_view what) const;
};

/// What a scene can ask of a material; FitOptions::region. A fit puts its nodes there, and is only
/// bound to be right there; outside, what is drawn is that of the nearest border.
///
/// Of the set's directions a material then keeps those with a weight and those that a box is
/// interpolated from (without weights: the latter alone); its views() and lights() are these.
/// Errors are squared and weighted over the pairs of the two; what pairs without weight show
/// follows from the others. Only ratios of weights matter; one under 1e-8 of the largest is none.
struct FitRegion {
  PairWeights weights;  ///< empty: all pairs alike
  DirectionBox views;
  DirectionBox lights;
  /// Errors: kInvalidOption, of its parts.
  [[nodiscard]] Status check(const SampleSetInfo& info) const;
};

}  // namespace veneer::btf
