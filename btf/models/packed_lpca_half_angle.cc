// SPDX-License-Identifier: Apache-2.0
#include <Eigen/QR>

#include <algorithm>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "btf/models/packed_lpca.h"

// The second function, where it is one of the half angle.
namespace veneer::btf {

// [cluster * component][pair]
RowMatrix PackedLpca::second_brdfs() const {
  const auto [first, count] = layout_.components;
  RowMatrix brdfs(factors_.clusters * count, frame_.pair_count());
  for (int k = 0; k < factors_.clusters; ++k)
    for (int j = 0; j < count; ++j) {
      const std::span<const Eigen::half> brdf = factors_.eigen_brdf(k, first + j);
      std::ranges::transform(brdf, brdfs.row(k * count + j).begin(), [](Eigen::half value) {
        return static_cast<float>(value);
      });
    }
  return brdfs;
}

PackedLpca PackedLpca::with_half_angle(const Read& read,
                                       const FittedPairs& pairs,
                                       Communicator& ranks) const {
  const Eigen::VectorXf importance = pairs.all_weights().matrix();
  const int first = layout_.components[0];
  const int count = layout_.components[1];
  const RowMatrix brdfs = half_angle::values_at(
      frame_.views, frame_.lights, half_angle::fill(frame_.views, frame_.lights, second_brdfs()));
  LpcaFactors factors = factors_;
  const auto components = static_cast<std::size_t>(factors.components);
  const auto columns = static_cast<std::size_t>(factors.columns);
  std::vector<Eigen::MatrixXf> weights_from_values;  // of each cluster, the pseudo-inverse
  for (int k = 0; k < factors.clusters; ++k) {
    RowMatrix own = brdfs.middleRows(k * count, count);
    for (int j = 0; j < count; ++j) {
      const float largest = own.row(j).cwiseAbs().maxCoeff();
      if (largest > 0.0F) own.row(j) /= largest;
      const std::size_t at =
          static_cast<std::size_t>(k) * components + static_cast<std::size_t>(first + j);
      std::ranges::transform(
          own.row(j),
          factors.eigen_brdfs.begin() + static_cast<std::ptrdiff_t>(at * columns),
          saturated_half);
    }
    const RowMatrix weighted = own * importance.asDiagonal();
    const Eigen::MatrixXd gram = (weighted * own.transpose()).cast<double>();
    weights_from_values.emplace_back(
        (gram.completeOrthogonalDecomposition().pseudoInverse() * weighted.cast<double>())
            .cast<float>());
  }
  const RowRange own = rows_of_rank(pyramid().texel_count(), ranks);
  std::vector<Eigen::half> weights(static_cast<std::size_t>(own.count) *
                                   static_cast<std::size_t>(count));
  parallel_for(own.count, 16, [&](std::int64_t begin, std::int64_t end) {
    Eigen::VectorXf other(frame_.pair_count());
    Eigen::VectorXf values(frame_.pair_count());
    for (auto i = static_cast<int>(begin); i < end; ++i) {
      const int texel = own.first + i;
      read(texel, {other.data(), columns}, {values.data(), columns});
      const Eigen::VectorXf found =
          weights_from_values[static_cast<std::size_t>(clusters_of(texel)[1])] * values;
      std::ranges::transform(found, weights.begin() + std::ptrdiff_t{i} * count, saturated_half);
    }
  });
  weights = gather<Eigen::half>(ranks, weights);
  for (std::size_t texel = 0; texel < factors.cluster.size(); ++texel)
    for (int j = 0; j < count; ++j)
      factors.weights[texel * components + static_cast<std::size_t>(first + j)] =
          weights[texel * static_cast<std::size_t>(count) + static_cast<std::size_t>(j)];
  Layout layout = layout_;
  layout.half_angle = true;
  return PackedLpca(frame_, layout, std::move(factors), second_cluster_);
}

void PackedLpca::fill_half_angles() {
  const auto [first, count] = layout_.components;
  volumes_.resize(static_cast<std::size_t>(volume_count()),
                  std::vector<Eigen::half>(half_place_.texel_count() * kScalarsPerVolume));
  const RowMatrix nodes = half_angle::fill(frame_.views, frame_.lights, second_brdfs());
  for (int k = 0; k < factors_.clusters; ++k)
    for (int j = 0; j < count; ++j) {
      const Slot at = slot(first + j);
      for (int node = 0; node < half_angle::kNodes; ++node)
        volumes_[at.volume][half_place_.texel(k, node) * kScalarsPerVolume + at.channel] =
            saturated_half(nodes(k * count + j, node));
    }
}

}  // namespace veneer::btf
