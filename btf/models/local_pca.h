// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "btf/communicator.h"
#include "btf/models/matrix_product.h"

namespace veneer::btf {

/// A data matrix that need not fit into memory: one row per texel. A row may consist of several
/// parts that share their cluster but have eigenvectors of their own (two scalar functions, say).
struct RowSource {
  int rows = 0;
  /// Columns of each part; a row is the parts one after the other.
  std::vector<int> part_columns;
  /// Writes row `row`, the sum of part_columns floats. Called several times for each row, from
  /// several threads.
  std::function<void(int row, std::span<float> values)> read;

  [[nodiscard]] int columns() const;
};

struct LocalPcaOptions {
  /// Clusters asked for, >= 1; there are never more than rows.
  int clusters = 32;
  /// Eigenvectors of each part in each cluster, >= 1 each.
  std::vector<int> components;
  /// Columns of the randomised basis (for each part) in which clusters are found; 0 keeps the data
  /// as they are, which must then fit into memory.
  int basis = 160;
  int iterations = 60;  ///< of Lloyd's algorithm at most, from each start and after each swap
  std::uint64_t seed = 1;
};

/// Uncentred local principal component analysis: row x in cluster k is about
/// sum_j weight(x, j) * eigenvectors(k, j), for each part.
struct LocalPca {
  int clusters = 0;
  std::vector<std::uint8_t> cluster;    ///< [row]
  RowMatrix weights;                    ///< [row][component], the parts' components in turn
  std::vector<RowMatrix> eigenvectors;  ///< per part, [cluster * components][column], orthonormal
  double unexplained = 0.0;             ///< squared error over squared values, 0 for zero data
  int iterations = 0;                   ///< Lloyd's, of the start and the swaps that were kept
};

/// Fits by alternating assignment and principal components, from a k-means start.
///
/// Clusters are found in a randomised orthonormal basis of the rows, which keeps the distances that
/// matter; the eigenvectors are then refined, and the weights projected, in the full space. Memory:
/// a few times (rows + columns) * basis floats for each part and blocks of some thousand rows,
/// never all rows at all columns, but for basis 0. Each of `ranks` reads, holds and works on the
/// rows that rows_of_rank() gives it, and has the whole result in the end. The same for a seed on
/// one machine, whatever the number of threads; on other numbers of ranks the same but for
/// rounding. Defined for any finite data: eigenvectors beyond a cluster's rank are zero, and so are
/// those of clusters that stay empty because there are fewer different rows than clusters.
///
/// Sources: Kambhatla and Leen 1997, "Dimension Reduction by Local Principal Component Analysis";
/// Mueller, Meseth, Klein 2003, "Compression and Real-Time Rendering of Measured BTFs Using Local
/// PCA"; the basis: Halko, Martinsson, Tropp 2011, "Finding Structure with Randomness", algorithm
/// 4.4; the start: Arthur and Vassilvitskii 2007, "k-means++".
[[nodiscard]] LocalPca fit_local_pca(const RowSource& source,
                                     const LocalPcaOptions& options,
                                     Progress& progress,
                                     Communicator& ranks = alone());

}  // namespace veneer::btf
