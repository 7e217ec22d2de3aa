// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/progress.h"
#include "btf/material.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/layered/layer_stack.h"
#include "btf/sample_set.h"

namespace veneer::btf {

struct LayerFit {
  LayerStack stack;
  /// Points of layers for which no solve held, which kept what they had before it or stay diffuse.
  int fallback_points = 0;
};

/// Finds a stack of layers in a sample set, after Magda and Kriegman 2005, section 4.
/// @param set  finite; within float16's range, as fit_scaled() leaves it.
/// @param options  checked
[[nodiscard]] LayerFit fit_layers(const SampleSet& set,
                                  const FittedPairs& pairs,
                                  const FitOptions& options,
                                  Progress& progress);

}  // namespace veneer::btf
