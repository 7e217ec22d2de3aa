// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "base/progress.h"
#include "btf/models/row_clusters.h"

namespace veneer::btf {

/// Refines the directions of clusters to eigenvectors in the full space and projects the rows on
/// them: fills pca.eigenvectors, pca.unexplained and, of pca.weights, the rows `rows` of this rank.
/// The clusters are worked on a group at a time, as many as kGroupBytes hold.
void refine_eigenvectors(const RowSource& source,
                         std::span<const int> rows,
                         const Projection& projection,
                         const RowClusters& clusters,
                         const LocalPcaOptions& options,
                         Communicator& ranks,
                         Progress& progress,
                         LocalPca& pca);

/// Memory for the eigenvectors that are refined together, and the sums for them.
constexpr double kGroupBytes = 256e6;

}  // namespace veneer::btf
