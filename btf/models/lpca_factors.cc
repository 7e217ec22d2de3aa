// SPDX-License-Identifier: Apache-2.0
#include "btf/models/lpca_factors.h"

#include <algorithm>

#include "btf/models/weighted_pca.h"

namespace veneer::btf {

std::span<const Eigen::half> LpcaFactors::weights_of(int texel) const {
  const auto count = static_cast<std::size_t>(components);
  return std::span(weights).subspan(static_cast<std::size_t>(texel) * count, count);
}

std::span<const Eigen::half> LpcaFactors::eigen_brdf(int in_cluster, int component) const {
  const auto index = static_cast<std::size_t>(in_cluster) * static_cast<std::size_t>(components) +
                     static_cast<std::size_t>(component);
  const auto count = static_cast<std::size_t>(columns);
  return std::span(eigen_brdfs).subspan(index * count, count);
}

double LpcaFactors::values_per_texel(int texels) const {
  return 1.0 + components + double(clusters) * components * columns / texels;
}

void LpcaFactors::reconstruct(
    int texel, int in_cluster, int first, int count, std::span<float> values) const {
  using Halves = Eigen::Map<const Eigen::Array<Eigen::half, Eigen::Dynamic, 1>>;
  Eigen::Map<Eigen::ArrayXf> sum(values.data(), static_cast<Eigen::Index>(values.size()));
  sum.setZero();
  const std::span<const Eigen::half> weight = weights_of(texel);
  for (int j = first; j < first + count; ++j) {
    const auto brdf = eigen_brdf(in_cluster, j);
    sum += static_cast<float>(weight[static_cast<std::size_t>(j)]) *
           Halves(brdf.data(), columns).cast<float>();
  }
}

LpcaFactors factors_of(const LocalPca& pca) {
  LpcaFactors factors;
  factors.clusters = pca.clusters;
  factors.components = static_cast<int>(pca.weights.cols());
  factors.columns = static_cast<int>(pca.eigenvectors.front().cols());
  factors.cluster = pca.cluster;
  factors.eigen_brdfs.resize(static_cast<std::size_t>(factors.clusters) *
                             static_cast<std::size_t>(factors.components) *
                             static_cast<std::size_t>(factors.columns));
  // Weights grow by what an Eigen-BRDF shrinks.
  RowMatrix scales(factors.clusters, factors.components);
  auto out = factors.eigen_brdfs.begin();
  for (int k = 0; k < factors.clusters; ++k) {
    int component = 0;
    for (const RowMatrix& part : pca.eigenvectors) {
      VENEER_CHECK(part.cols() == factors.columns);
      const auto count = part.rows() / factors.clusters;
      for (Eigen::Index j = 0; j < count; ++j, ++component) {
        const auto row = part.row(k * count + j);
        const float largest = row.cwiseAbs().maxCoeff();
        scales(k, component) = largest;
        const float shrink = largest > 0.0F ? 1.0F / largest : 0.0F;
        for (const float value : row) *out++ = Eigen::half(value * shrink);
      }
    }
  }
  for (Eigen::Index texel = 0; texel < pca.weights.rows(); ++texel)
    for (int j = 0; j < factors.components; ++j)
      factors.weights.push_back(saturated_half(
          pca.weights(texel, j) * scales(pca.cluster[static_cast<std::size_t>(texel)], j)));
  return factors;
}

LpcaFactors side_by_side(const LpcaFactors& first, const LpcaFactors& second) {
  VENEER_CHECK(first.clusters == second.clusters && first.columns == second.columns);
  LpcaFactors both;
  both.clusters = first.clusters;
  both.components = first.components + second.components;
  both.columns = first.columns;
  both.cluster = first.cluster;
  // Rows of `left` and of `right` in turn.
  const auto interleave = [](const std::vector<Eigen::half>& left,
                             int left_row,
                             const std::vector<Eigen::half>& right,
                             int right_row) {
    std::vector<Eigen::half> all;
    all.reserve(left.size() + right.size());
    auto next = right.begin();
    for (auto row = left.begin(); row != left.end(); row += left_row, next += right_row) {
      all.insert(all.end(), row, row + left_row);
      all.insert(all.end(), next, next + right_row);
    }
    return all;
  };
  both.weights = interleave(first.weights, first.components, second.weights, second.components);
  both.eigen_brdfs = interleave(first.eigen_brdfs,
                                first.components * first.columns,
                                second.eigen_brdfs,
                                second.components * second.columns);
  return both;
}

Status check_samples(const SampleSet& set, const FitOptions& options) {
  const RowRange own = rows_of_rank(set.info().texel_count(), *options.ranks);
  return agree(*options.ranks, set.check_finite(own.first, own.count));
}

LpcaFactors fit_factors(const RowSource& source,
                        const std::vector<int>& components,
                        std::span<const float> column_weights,
                        const FitOptions& options,
                        Progress& progress) {
  return factors_of(fit_weighted_pca(source,
                                     column_weights,
                                     {.clusters = options.clusters,
                                      .components = components,
                                      .basis = options.basis,
                                      .iterations = options.iterations,
                                      .seed = options.seed},
                                     progress,
                                     *options.ranks));
}

void add_factors(const LpcaFactors& factors, int texels, Material::Contents& contents) {
  contents.tensors.push_back(tensor_of("clusters", {texels}, factors.cluster));
  contents.tensors.push_back(tensor_of("weights", {texels, factors.components}, factors.weights));
  contents.tensors.push_back(tensor_of(
      "eigen_brdfs", {factors.clusters, factors.components, factors.columns}, factors.eigen_brdfs));
}

Result<LpcaFactors> read_factors(const SafetensorsFile& file,
                                 int texels,
                                 int components,
                                 int columns) {
  VENEER_ASSIGN(const TensorView brdfs,
                file.tensor("eigen_brdfs", DType::kF16, {-1, components, columns}));
  constexpr int kMostClusters = 256;
  if (brdfs.shape.front() < 1 || brdfs.shape.front() > kMostClusters)
    return fail(Errc::kBadFormat,
                "reading {}: it has {} clusters; there may be 1 to {}",
                file.path().string(),
                brdfs.shape.front(),
                kMostClusters);
  LpcaFactors factors;
  factors.clusters = static_cast<int>(brdfs.shape.front());
  factors.components = components;
  factors.columns = columns;
  VENEER_ASSIGN(factors.eigen_brdfs, read_halves(file, "eigen_brdfs", brdfs.shape));
  VENEER_ASSIGN(factors.weights, read_halves(file, "weights", {texels, components}));
  VENEER_ASSIGN(factors.cluster, read_clusters(file, "clusters", texels, factors.clusters));
  return factors;
}

}  // namespace veneer::btf
