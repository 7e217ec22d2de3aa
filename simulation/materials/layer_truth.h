// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <span>
#include <vector>

#include "simulation/materials/body_field.h"

namespace veneer::simulation {

/// What a stack of layers ought to find in a field of bodies. A layer stands for all that is nearer
/// to its height than to that of another.
struct LayerTruth {
  /// Over how much of a texel there is matter of the layer, 0 to 1: [layer][texel]. 1 on the
  /// ground.
  std::vector<float> occupancy;
  /// Of that matter as it is seen from straight above, averaged; unit, local frame
  /// (btf/direction.h); 0 where there is none. [layer][texel]
  std::vector<Eigen::Vector3f> normals;
};

/// @param field  valid (BodyField::check)   @param size  texels along each side, > 0
/// @param heights  of the layers over the ground, tile widths, from the top, falling strictly
[[nodiscard]] LayerTruth layer_truth(const BodyField& field,
                                     int size,
                                     std::span<const double> heights);

}  // namespace veneer::simulation
