// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/progress.h"
#include "btf/material.h"
#include "btf/sample_set.h"

namespace veneer::btf {

/// Error over all texels, pairs and channels. epsilon is the mean absolute difference (Meseth et
/// al. 2003, section 5), its min and max are over the (view, light) images.
struct ImageError {
  double epsilon_avg{};
  double epsilon_min{};
  double epsilon_max{};
  double rmse{};
};

/// How well a material reproduces a sample set at the measured directions.
struct Evaluation {
  ImageError linear;   ///< in linear light, both sides cut to [0, 1]
  ImageError encoded;  ///< after cutting to [0, 1] and the exponent 1/2.2, as the tables are
  double psnr_db{};    ///< of the encoded values
  double
      de00_mean{};  ///< CIEDE2000, samples as sRGB, white = sample 1; over a fixed subset of pairs
  double de00_p95{};
  double drawn_epsilon_avg{};  ///< encoded, as the shader draws at the measured directions
  double bytes_per_texel{};
  int fetches{};
};

/// Errors: kBadFormat where material and set differ in size or directions.
[[nodiscard]] Result<Evaluation> evaluate(const SampleSet& set,
                                          const Material& material,
                                          Progress& progress);

}  // namespace veneer::btf
