// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "capture/development/developer.h"

namespace veneer::capture {

struct SetOptions {
  /// What becomes of a texel that was saturated in every exposure: a refusal, or the mean of the
  /// nearest texels of the same direction that were not. It is counted either way.
  bool fill_masked = false;
};

/// What a set came to.
struct DevelopedSet {
  std::vector<DirectionFindings> directions;  ///< [view][light]
  double masked_fraction = 0;                 ///< of the samples, filled if there are any
  /// Samples below 0 become 0 in the set; how many of each part, and how much light that adds in
  /// the mean.
  double specular_negative = 0, diffuse_negative = 0;
  double light_added = 0;
};

/// Called with each direction, in order, before its negative values are cut.
using DirectionSink = std::function<Status(const DevelopedDirection&)>;

/// Develops every direction of the plan into a polarised sample set (btf/sample_set.h), whole or
/// not at all.
/// Errors: those of Developer::develop(), of the sink; kBadFormat (masked texels, and in which
/// directions, unless fill_masked), kIo.
[[nodiscard]] Result<DevelopedSet> write_sample_set(const Developer& developer,
                                                    const std::filesystem::path& path,
                                                    const SetOptions& options,
                                                    const DirectionSink& sink,
                                                    Progress& progress);

}  // namespace veneer::capture
