// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "btf/fit_region.h"
#include "btf/models/material_tensors.h"
#include "btf/texel_pyramid.h"

namespace veneer::btf {

/// The measured pairs that a fit looks at and how much each counts: all alike, or those of a
/// FitRegion, which says what is kept. Immutable and thread-safe.
class FittedPairs {
 public:
  /// @param region  null: all pairs alike. Errors: kInvalidOption, of FitRegion::check().
  [[nodiscard]] static Result<FittedPairs> of(const SampleSetInfo& info, const FitRegion* region);

  /// The directions that are kept, in the set's order.
  [[nodiscard]] const MaterialFrame& frame() const { return frame_; }
  [[nodiscard]] const DirectionBoxes& boxes() const { return boxes_; }
  /// Of each pair of the frame, [view][light], the largest being 1; empty where all count alike.
  [[nodiscard]] std::span<const float> weights() const { return weights_; }
  /// Of `channels` columns for each pair; empty as weights() are.
  [[nodiscard]] std::vector<float> column_weights(int channels) const;
  /// weights() for formulas that are fitted to every texel, or empty: pairs without weight count a
  /// millionth, so that a view or a light that nobody asks for still shows what it did.
  [[nodiscard]] std::vector<float> weights_everywhere() const;
  /// weights(), written out.
  [[nodiscard]] Eigen::ArrayXf all_weights() const;
  /// Of each pair of the frame its number in the set, view * lights + light.
  [[nodiscard]] std::vector<int> numbers(const SampleSetInfo& info) const;
  /// As SampleSet::rgb(), at the pairs of the frame.
  void rgb(const SampleSet& set, int texel, Part part, std::span<float> out) const;
  /// As pyramid_rgb(), at the pairs of the frame.
  void rgb(const SampleSet& set,
           const TexelPyramid& pyramid,
           int texel,
           Part part,
           std::span<float> out) const;

 private:
  MaterialFrame frame_;
  DirectionBoxes boxes_;
  std::vector<int> pairs_;  // of the set; empty where the frame is the set's
  std::vector<float> weights_;
};

}  // namespace veneer::btf
