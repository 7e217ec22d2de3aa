// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/direction.h"
#include "btf/models/layered/layer_stack.h"
#include "simulation/materials/layer_truth.h"

namespace veneer::simulation {

/// How much of the truth a stack of layers tells. Only points that can be seen are judged: those
/// that the truth's own layers above leave open to at least a tenth of the views.
struct LayerAgreement {
  int judged = 0;          ///< points above the lowest layer, which is opaque by agreement
  double occupancy = 0.0;  ///< share of them that are matter or clear as they should be
  /// The same with all clear and all opaque, whichever is better: what knowing nothing gives.
  double occupancy_of_none = 0.0;
  int compared = 0;  ///< judged points of matter that the stack has too
  /// Between normals, over those; half of the points are nearer.
  double normal_median_deg = 0.0;
  /// The same if all normals were along z.
  double normal_median_of_level_deg = 0.0;
};

/// @param truth  of the stack's size, at its heights
[[nodiscard]] LayerAgreement layer_agreement(const btf::LayerStack& stack,
                                             const LayerTruth& truth,
                                             const btf::DirectionSet& views);

}  // namespace veneer::simulation
