// SPDX-License-Identifier: Apache-2.0
#include "btf/fit_region.h"

#include <algorithm>
#include <cmath>

namespace veneer::btf {

Status PairWeights::check(const SampleSetInfo& info) const {
  if (weight.size() != static_cast<std::size_t>(info.pair_count()))
    return fail(Errc::kInvalidOption,
                "weighting a fit: there are {} weights for {} pairs of directions",
                weight.size(),
                info.pair_count());
  if (!std::ranges::all_of(weight, [](float w) { return std::isfinite(w) && w >= 0.0F; }))
    return fail(Errc::kInvalidOption,
                "weighting a fit: a weight is negative or no number; all must be 0 or more");
  if (std::ranges::all_of(weight, [](float w) { return w == 0.0F; }))
    return fail(Errc::kInvalidOption, "weighting a fit: all weights are 0, so nothing would count");
  return {};
}

Status DirectionBox::check(std::string_view what) const {
  // Written so that NaN is refused too.
  if (u_min >= 0 && u_min <= u_max && u_max <= 1 && v_min >= 0 && v_min <= v_max && v_max <= 1)
    return {};
  return fail(Errc::kInvalidOption,
              "restricting a fit: the box of the {} is {} to {} by {} to {}; both must ascend "
              "within 0 to 1",
              what,
              u_min,
              u_max,
              v_min,
              v_max);
}

Status FitRegion::check(const SampleSetInfo& info) const {
  VENEER_TRY(views.check("views"));
  VENEER_TRY(lights.check("lights"));
  return weights.weight.empty() ? Status() : weights.check(info);
}

}  // namespace veneer::btf
