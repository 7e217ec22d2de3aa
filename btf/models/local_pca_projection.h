// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "base/progress.h"
#include "btf/models/local_pca_rows.h"

namespace veneer::btf {

/// The data in few columns: coordinates = rows * basis^T for each part.
struct Projection {
  /// Per part, [dimension][column], orthonormal rows; none where the columns are kept as they are.
  std::vector<RowMatrix> basis;
  std::vector<ColumnRange> ranges;  ///< of each part's coordinates
  RowMatrix coordinates;            ///< [own row][sum of dimensions]
};

/// Finds a basis of all ranks' rows and the coordinates of this rank's rows `rows` in it. With
/// options.basis = 0 the columns are kept.
/// Source: Halko, Martinsson, Tropp 2011, "Finding Structure with Randomness", algorithm 4.4.
[[nodiscard]] Projection project(const RowSource& source,
                                 std::span<const int> rows,
                                 const LocalPcaOptions& options,
                                 Communicator& ranks,
                                 Progress& progress);

}  // namespace veneer::btf
