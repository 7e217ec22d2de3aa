// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>

#include "base/progress.h"
#include "base/result.h"
#include "btf/material.h"
#include "btf/texel_map.h"

namespace veneer::btf {

/// What texels are compared by when patches of a sample are put together.
struct TexelFeatures {
  static constexpr int kCount = 8;
  using Values = Eigen::Matrix<float, kCount, Eigen::Dynamic>;

  int width = 0;   ///< texels
  int height = 0;  ///< texels
  Values values;   ///< a column for each texel, row by row; finite but for a damaged material's
};

/// The features of a material's texels: the square roots of what they send at a dozen measured
/// pairs of directions spread over the hemisphere, slanted ones too, so that texels with parallax
/// differ by what stands around them; of these the first principal
/// components.
[[nodiscard]] TexelFeatures texel_features(const Material& material);

struct SynthesisOptions {
  int width = 512;   ///< places, not below the sample's
  int height = 512;  ///< places, not below the sample's
  int patch = 16;    ///< texels along a patch's side, at most the sample's
  int overlap = 4;   ///< texels, 1 to half a patch: how far patches lie over each other at least
  /// Whether the sample is a tile itself, so that patches may reach around its edges.
  bool source_wraps = false;
  std::uint64_t seed = 1;
  /// Errors: kInvalidOption, naming the option and what it may be.
  [[nodiscard]] Status check(int sample_width, int sample_height) const;
};

/// Covers a larger tile, which repeats without a seam, with patches of a sample: image quilting
/// with minimum-error boundary cuts (Efros and Freeman 2001), around the tile's edges too. A patch
/// is drawn from those that differ least from what they overlap; ones that would go on with a
/// neighbour's piece of the sample, or show again what is near, are left out as long as there are
/// others. The same map for the same options, on any number of threads.
///
/// Every patch is compared everywhere: work grows as (width height / patch) times overlap times the
/// sample's texels.
/// Errors: kInvalidOption of SynthesisOptions::check(); kBadFormat (a feature is not finite).
[[nodiscard]] Result<TexelMap> synthesize_texels(const TexelFeatures& features,
                                                 const SynthesisOptions& options,
                                                 Progress& progress);

/// How a map looks beside plain repeats of its sample. Steps are distances between the features of
/// neighbours, each relative to the mean step between neighbours within the sample.
struct MapQuality {
  double seam_step = 0.0;    ///< mean, where neighbours in the map are none in the sample; 0: none
  double tiling_step = 0.0;  ///< mean, over the edges of plain repeats
  /// Correlation of the map with itself one width of the sample aside and one height down, the
  /// larger of the two; plain repeats have 1.
  double repetition = 0.0;
  double texels_used = 0.0;  ///< share of the sample's texels that the map shows
};
[[nodiscard]] MapQuality quality_of(const TexelMap& map, const TexelFeatures& features);

}  // namespace veneer::btf
