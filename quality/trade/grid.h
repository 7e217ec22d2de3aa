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
  kCoarse,  ///< some 60 ways to draw: minutes
  kFine,    ///< several hundred: hours
};
/// "coarse" or "fine". Errors: kInvalidOption.
[[nodiscard]] Result<Grid> parse_grid(std::string_view text);
[[nodiscard]] std::string_view name_of(Grid grid);

/// What is measured: each model of the registry that the set allows, at several sizes (components,
/// clusters, lobes, layers, angular resolution, storage precision) and drawn in several ways
/// (hardware volumes per pixel or the angular cache, with or without the mean over texels, render
/// scale). Each once, those of one fit beside each other. In the coarse grid a model is drawn in
/// every way at its first size; its other sizes in those two that show what the size does: per
/// pixel and from the cache, texels averaged, at full scale.
struct GridOptions {
  Grid grid = Grid::kCoarse;
  std::vector<std::string> models{};  ///< of the registry; none: all
  int iterations = 20;                ///< as FitOptions has it
  std::uint64_t seed = 1;             ///< as FitOptions has it
};
/// Errors: kInvalidOption where a model is unknown or the set does not allow it.
[[nodiscard]] Result<std::vector<Candidate>> candidates_of(const btf::SampleSetInfo& set,
                                                           const GridOptions& options);

}  // namespace veneer::quality
