// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "base/progress.h"
#include "btf/sample_set.h"

namespace veneer::btf {

/// A view that never moves, a light that never does, or both, of length 1. A scene of such needs
/// two dimensions less of a material (four of both), and models drop them by themselves.
struct FixedDirections {
  std::optional<Direction> view;
  std::optional<Direction> light;
};

/// Writes to `folder` what `set` shows from the fixed view and under the fixed light, linear
/// between the measured directions around them (SphericalInterpolator), and opens it. A measured
/// direction keeps its very samples. All parts of a polarised set are kept.
/// Errors: kInvalidOption (a direction beyond the measured ones, or neither given), kIo.
[[nodiscard]] Result<SampleSet> fix_directions(const SampleSet& set,
                                               const FixedDirections& fixed,
                                               const std::filesystem::path& folder,
                                               Progress& progress);

}  // namespace veneer::btf
