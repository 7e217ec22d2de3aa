// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/interpolated_set.h"
#include "simulation/bench.h"

namespace veneer::simulation {

/// A measured or synthesised sample as the bench's material, interpolated linearly in double
/// precision.
/// @param set  borrowed; must outlive the source.
[[nodiscard]] TexelSource texel_source(const btf::InterpolatedSet& set);

}  // namespace veneer::simulation
