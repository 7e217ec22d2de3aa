// SPDX-License-Identifier: Apache-2.0
#include "btf/models/local_pca.h"

#include <algorithm>
#include <numeric>

#include "base/result.h"
#include "btf/models/cluster_eigenvectors.h"
#include "btf/models/local_pca_projection.h"
#include "btf/models/row_clusters.h"

namespace veneer::btf {
namespace {

// Every rank's clusters and weights, on every rank.
void gather_rows(RowRange own, LocalPca& pca, Communicator& ranks) {
  if (ranks.size() == 1) return;
  const auto first = pca.cluster.begin() + own.first;
  const std::vector<std::uint8_t> cluster(first, first + own.count);
  pca.cluster = gather<std::uint8_t>(ranks, cluster);
  const RowMatrix weights = pca.weights.middleRows(own.first, own.count);
  const std::vector<float> all =
      gather<float>(ranks, {weights.data(), static_cast<std::size_t>(weights.size())});
  std::ranges::copy(all, pca.weights.data());
}

}  // namespace

int RowSource::columns() const {
  return std::accumulate(part_columns.begin(), part_columns.end(), 0);
}

LocalPca fit_local_pca(const RowSource& source,
                       const LocalPcaOptions& options,
                       Progress& progress,
                       Communicator& ranks) {
  VENEER_CHECK(source.rows > 0 && options.clusters >= 1 && options.clusters <= 256);
  VENEER_CHECK(source.part_columns.size() == options.components.size());
  VENEER_CHECK(std::ranges::all_of(options.components, [](int count) { return count >= 1; }));

  const RowRange own = rows_of_rank(source.rows, ranks);
  std::vector<int> rows(static_cast<std::size_t>(own.count));
  std::iota(rows.begin(), rows.end(), own.first);
  LocalPca pca;
  pca.clusters = std::min(options.clusters, source.rows);
  const Projection projection = project(source, rows, options, ranks, progress);
  const RowClusters clusters =
      find_clusters(projection, own, pca.clusters, options, ranks, progress);
  pca.iterations = clusters.iterations;
  pca.cluster.resize(static_cast<std::size_t>(source.rows));
  std::ranges::copy(clusters.cluster, pca.cluster.begin() + own.first);

  pca.weights = RowMatrix::Zero(
      source.rows, std::accumulate(options.components.begin(), options.components.end(), 0));
  for (std::size_t p = 0; p < source.part_columns.size(); ++p)
    pca.eigenvectors.emplace_back(
        RowMatrix::Zero(pca.clusters * options.components[p], source.part_columns[p]));
  refine_eigenvectors(source, rows, projection, clusters, options, ranks, progress, pca);
  gather_rows(own, pca, ranks);
  return pca;
}

}  // namespace veneer::btf
