// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/result.h"
#include "btf/direction.h"

namespace veneer::simulation {

/// Rings of directions from the normal to 75 degrees, by how many there are:
/// 1 is the normal alone; 25 and 49 in the manner of the Bonn sets, for quick trials; 81 is
/// btf::bonn_directions(); 151 is the direction list of the UBO2014 dome, via btflib (theta 0,
/// 11, 23.5, 30, 37.5, ... 75 degrees). Errors: kInvalidOption for any other count, naming these.
[[nodiscard]] Result<btf::DirectionSet> ring_directions(int count);

}  // namespace veneer::simulation
