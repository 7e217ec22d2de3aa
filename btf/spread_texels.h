// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "btf/sample_set.h"

namespace veneer::btf {

/// Texels that stand for a whole sample: all in order where it has no more than are wanted, else
/// that many of Roberts' two-dimensional sequence (2018, "The Unreasonable Effectiveness of
/// Quasirandom Sequences", alpha of the plastic number), which follows no row or column of a weave.
/// Where nearly all are wanted, some come twice.
[[nodiscard]] std::vector<int> spread_texels(const SampleSetInfo& info, int wanted);

}  // namespace veneer::btf
