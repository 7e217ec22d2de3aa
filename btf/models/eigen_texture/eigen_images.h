// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "btf/models/components.h"
#include "btf/models/fitted_pairs.h"
#include "btf/models/material_tensors.h"

namespace veneer::btf {

/// Eigen-textures and their weights as they are stored and drawn (eigen_texture.h). Value
/// `3 * component + channel` of a texel's image is
/// - 8bit: (code - zero(component)) / 255,
/// - float16: the number itself,
/// within [-1, 1] but for rounding; the scale is in the weights.
struct EigenImages {
  int components = 0;
  Precision precision = Precision::k8Bit;
  std::vector<Eigen::half> weights;  ///< [view][light][component]
  std::vector<std::uint8_t> zeros;   ///< [component], 8bit only: the code of 0, <= kMostZero
  std::vector<std::uint8_t> codes;   ///< [view][texel][component][3], 8bit only
  std::vector<Eigen::half> halves;   ///< the same, float16 only

  /// Codes above 0's are at least as many as those below.
  static constexpr int kMostZero = 127;
  [[nodiscard]] int values() const { return 3 * components; }  ///< of a texel and view
  [[nodiscard]] Eigen::Vector3d image(std::size_t view_and_texel, int component) const;
};

/// Errors of a view's lights count by their weights; lights without one get what the images explain
/// of them in the least squares, and a view without any counts all alike.
/// @param pairs  whose frame the images and weights are of
/// @param components  1 or more; those beyond the number of lights are 0.
[[nodiscard]] EigenImages fit_eigen_images(const SampleSet& set,
                                           const FittedPairs& pairs,
                                           int components,
                                           Precision precision,
                                           Progress& progress);

}  // namespace veneer::btf
