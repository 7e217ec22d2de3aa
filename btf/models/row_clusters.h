// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/progress.h"
#include "btf/models/local_pca_projection.h"

namespace veneer::btf {

/// Rows in clusters, each with principal directions of its own in the coordinates of a projection.
struct RowClusters {
  std::vector<int> cluster;  ///< [own row]
  /// [part][cluster]: the directions of a cluster, first the leading ones, and some beyond those
  /// that were asked for, [carried][dimension]; orthonormal, arbitrary beyond the cluster's rank.
  std::vector<std::vector<RowMatrix>> vectors;
  int iterations = 0;  ///< Lloyd's, of the start and the swaps that were kept
};

/// Lloyd's algorithm with principal directions for centres (Kambhatla and Leen 1997), from several
/// k-means starts, improved by swaps.
/// @param own  which of all ranks' rows are in `projection`
[[nodiscard]] RowClusters find_clusters(const Projection& projection,
                                        RowRange own,
                                        int clusters,
                                        const LocalPcaOptions& options,
                                        Communicator& ranks,
                                        Progress& progress);

/// One step of subspace iteration: from rows `vectors` = V, orthonormal, and `mixed` = V * A with A
/// symmetric and positive semi-definite, to orthonormal rows that span `mixed`, leading ones first.
/// Returns the eigenvalues of V * A * V^T, descending.
/// Source: Golub and Van Loan 2013, "Matrix Computations", section 8.2.4 (orthogonal iteration with
/// Ritz acceleration).
Eigen::VectorXd subspace_step(RowMatrix& vectors, const DoubleRowMatrix& mixed);

/// Directions that are carried along beyond those that are wanted, so that the last wanted one
/// converges too (Halko et al. 2011, section 4.3, suggest 5 to 10).
constexpr int kOversampling = 6;

}  // namespace veneer::btf
