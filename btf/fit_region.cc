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

}  // namespace veneer::btf
