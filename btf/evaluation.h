// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/progress.h"
#include "btf/fit_region.h"
#include "btf/material.h"
#include "btf/sample_set.h"

namespace veneer::btf {

/// Error over all texels, pairs and channels, each pair by its weight where there are such. epsilon
/// is the mean absolute difference (Meseth et al. 2003, section 4.1).
struct ImageError {
  double epsilon_avg{};
  double epsilon_min{};  ///< of the (view, light) image that is met best
  double epsilon_max{};  ///< of the image that is met worst
  double rmse{};
  double texel_min{};  ///< epsilon of the texel that is met best, over its pairs and channels
  double texel_max{};  ///< of the texel that is met worst; the tables of Meseth et al. give these
};

/// How well a material reproduces a sample set at the measured directions.
struct Evaluation {
  ImageError linear;   ///< in linear light, both sides cut to [0, 1]
  ImageError encoded;  ///< after cutting to [0, 1] and the exponent 1/2.2, as the tables are
  double psnr_db{};    ///< of the encoded values; infinite where they are equal
  double
      de00_mean{};  ///< CIEDE2000, samples cut to [0, 1] as sRGB, white = sample 1; a fixed subset
  double de00_p95{};
  double
      drawn_epsilon_avg{};  ///< encoded, as the shader draws at the measured directions; a subset
  double bytes_per_texel{};
  int fetches{};
};

/// The same figures each time, on any number of threads. Of a polarised set the total is compared.
/// A material that keeps some of the set's directions (FitOptions::region) is compared there.
/// @param weights  how much each pair of the set counts, null: all of the material's alike. Of
/// pairs without weight nothing is told.
/// Errors: kBadFormat where the material has another size or a texel map, directions that the set
/// has not, or lacks some that have a weight, or where one of them holds NaN or infinite values;
/// kInvalidOption of PairWeights::check().
[[nodiscard]] Result<Evaluation> evaluate(const SampleSet& set,
                                          const Material& material,
                                          Progress& progress,
                                          const PairWeights* weights = nullptr);

}  // namespace veneer::btf
