// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/interpolated_set.h"
#include "btf/material.h"
#include "simulation/bench.h"

namespace veneer::simulation {

/// A measured or synthesised sample as the bench's material, interpolated linearly in double
/// precision.
/// @param set  borrowed; must outlive the source.
[[nodiscard]] TexelSource texel_source(const btf::InterpolatedSet& set);
/// A fitted material, as its shader draws it but in double precision: what arrives is then held
/// against what was meant to be drawn, and the error of the fit is left out.
/// @param material  borrowed; must outlive the source.
[[nodiscard]] TexelSource texel_source(const btf::Material& material);

}  // namespace veneer::simulation
