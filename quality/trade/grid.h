// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "btf/sample_set.h"
#include "quality/candidate.h"

namespace veneer::quality {

enum class Grid {
  kCoarse,  ///< some 60 to 90 ways to draw: minutes
  kFine,    ///< several hundred: hours
};
/// "coarse" or "fine". Errors: kInvalidOption.
[[nodiscard]] Result<Grid> parse_grid(std::string_view text);
[[nodiscard]] std::string_view name_of(Grid grid);

/// What is measured: each model of the registry that the set allows, at several sizes (components,
/// clusters, lobes, angular resolution, storage precision) and drawn in several ways (hardware
/// volumes per pixel or the angular cache, with or without the mean over texels, render scale).
/// Each once, those of one fit beside each other.
/// @param iterations, seed  as FitOptions has them.
[[nodiscard]] std::vector<Candidate> candidates_of(const btf::SampleSetInfo& set,
                                                   Grid grid,
                                                   int iterations,
                                                   std::uint64_t seed);

}  // namespace veneer::quality
