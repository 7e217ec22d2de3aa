// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace veneer {

/// The value below which the fraction `rank` of `values` lies, linear between the neighbours;
/// rank 0.5 is the median. 0 for no values. @param rank  in [0, 1]; clamped. NaN values are a bug.
[[nodiscard]] double quantile(std::vector<double> values, double rank);

/// The mean; 0 for no values.
[[nodiscard]] double mean(const std::vector<double>& values);

}  // namespace veneer
