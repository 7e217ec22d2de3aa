// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/models/local_pca.h"
#include "btf/models/material_tensors.h"

namespace veneer::btf {

/// The factors of a clustered model as they are stored and drawn: float16, each Eigen-BRDF scaled
/// so that its largest magnitude is 1, the inverse scale folded into the weights.
struct LpcaFactors {
  int clusters = 0;
  int components = 0;                    ///< of all terms
  int columns = 0;                       ///< values of one Eigen-BRDF
  std::vector<std::uint8_t> cluster;     ///< [texel]
  std::vector<Eigen::half> weights;      ///< [texel][component]
  std::vector<Eigen::half> eigen_brdfs;  ///< [cluster][component][column]

  [[nodiscard]] std::span<const Eigen::half> weights_of(int texel) const;
  [[nodiscard]] std::span<const Eigen::half> eigen_brdf(int in_cluster, int component) const;
  /// A texel's weights and cluster, and its share of the Eigen-BRDFs.
  [[nodiscard]] double values_per_texel(int texels) const;
  /// The sum of the components [first, first + count) of a texel at every column, with those of a
  /// cluster: the texel's own where none is named.
  void reconstruct(int texel, int in_cluster, int first, int count, std::span<float> values) const;
  void reconstruct(int texel, int first, int count, std::span<float> values) const {
    reconstruct(texel, cluster[static_cast<std::size_t>(texel)], first, count, values);
  }
};

/// @param pca  all parts with the same number of columns.
[[nodiscard]] LpcaFactors factors_of(const LocalPca& pca);

/// The factors of two functions that were clustered apart, into as many clusters each: every
/// cluster has the Eigen-BRDFs of both, every texel the weights of both, and the first one's
/// cluster.
[[nodiscard]] LpcaFactors side_by_side(const LpcaFactors& first, const LpcaFactors& second);

/// SampleSet::check_finite() of what each of options.ranks will read, with one outcome for all.
[[nodiscard]] Status check_samples(const SampleSet& set, const FitOptions& options);

/// Fits rows of one part for each of `components`, shared among options.ranks, and brings them to
/// the stored form.
/// @param column_weights  as fit_weighted_pca() takes them
[[nodiscard]] LpcaFactors fit_factors(const RowSource& source,
                                      const std::vector<int>& components,
                                      std::span<const float> column_weights,
                                      const FitOptions& options,
                                      Progress& progress);

/// Adds the tensors "clusters", "weights", "eigen_brdfs" to a material's contents.
void add_factors(const LpcaFactors& factors, int texels, Material::Contents& contents);
/// Reads them back. Errors: kBadFormat (shapes that do not fit, values that are not finite, a
/// cluster that is not there).
[[nodiscard]] Result<LpcaFactors> read_factors(const SafetensorsFile& file,
                                               int texels,
                                               int components,
                                               int columns);

}  // namespace veneer::btf
