// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/progress.h"
#include "btf/material.h"
#include "btf/models/fitted_pairs.h"
#include "btf/sample_set.h"

namespace veneer::btf {

struct LayerHeights {
  std::vector<float> heights;  ///< texels above the reference plane, from the top
  /// How far apart the sample's texels lie, root mean square, where parallax tells; 0 where it
  /// tells of next to none of them.
  double depth = 0.0;
};
/// Heights nearer to each other than this look alike, texels.
inline constexpr double kHeightResolution = 0.5;

/// Where the layers of a stack lie: as FitOptions::layers and ::heights say, and what they leave
/// open from the data. There every texel is followed through the views at each of many heights (a
/// plane sweep); the one at which it looks most alike is where it lies, if its surroundings have
/// contrast enough to tell. A sample whose depth is below kHeightResolution has one layer.
/// @param options  checked
[[nodiscard]] LayerHeights layer_heights(const SampleSet& set,
                                         const FittedPairs& pairs,
                                         const FitOptions& options,
                                         Progress& progress);

}  // namespace veneer::btf
