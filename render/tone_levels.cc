// SPDX-License-Identifier: Apache-2.0
#include "render/tone_levels.h"

#include <algorithm>

#include "base/result.h"

namespace veneer::render {
namespace {

// The highest level that is not above t; 0 where all are.
std::size_t highest_below(std::span<const float> levels, double t) {
  const auto above = std::upper_bound(levels.begin() + 1, levels.end(), t);
  return static_cast<std::size_t>(above - levels.begin()) - 1;
}

}  // namespace

ToneLevels::ToneLevels(std::span<const double> curve) {
  VENEER_CHECK(curve.size() >= 2 && curve.size() <= 65536);
  for (std::size_t code = 0; code < curve.size(); ++code) {
    // Compared as floats: two outputs that differ in double only would be a division by zero there.
    const auto level = static_cast<float>(curve[code]);
    if (!levels_.empty() && !(level > levels_.back())) continue;
    levels_.push_back(level);
    codes_.push_back(static_cast<std::uint16_t>(code));
  }
  VENEER_CHECK(levels_.front() == 0.0F && levels_.back() == 1.0F);

  // Each range is widened by a hundredth of a piece, far more than the error of a sqrt in float.
  constexpr double kMargin = 0.01;
  for (int i = 0; i < kSeeds; ++i) {
    const double from = std::max(0.0, (i - kMargin) / kSeeds);
    const double to = (i + 1 + kMargin) / kSeeds;
    seeds_.push_back({static_cast<std::uint16_t>(highest_below(levels_, from * from)),
                      static_cast<std::uint16_t>(highest_below(levels_, to * to))});
  }
}

ToneLevels::Bracket ToneLevels::bracket(double t) const {
  const std::size_t i = highest_below(levels_, t);
  if (i + 1 == levels_.size()) return {codes_[i], codes_[i], 0.0};
  const double fraction = (t - levels_[i]) / (static_cast<double>(levels_[i + 1]) - levels_[i]);
  return {codes_[i], codes_[i + 1], fraction};
}

}  // namespace veneer::render
