// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/progress.h"
#include "btf/material.h"
#include "btf/models/fitted_pairs.h"
#include "btf/sample_set.h"

namespace veneer::btf {

/// Where the layers of a stack lie, texels above the reference plane, from the top: as
/// FitOptions::layers and ::heights say, and what they leave open from the data. There every texel
/// is followed through the views at each of many heights (a plane sweep); the one at which it looks
/// most alike is where it lies, if its surroundings have contrast enough to tell. Heights nearer to
/// each other than half a texel cannot be told apart, and a set without parallax has one layer.
/// Errors: kInvalidOption (heights out of range or order).
[[nodiscard]] Result<std::vector<float>> layer_heights(const SampleSet& set,
                                                       const FittedPairs& pairs,
                                                       const FitOptions& options,
                                                       Progress& progress);

}  // namespace veneer::btf
