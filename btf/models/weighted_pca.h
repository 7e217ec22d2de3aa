// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "btf/models/local_pca.h"

namespace veneer::btf {

/// fit_local_pca() in a norm that counts the squared error of each column by its weight: rows are
/// scaled by the weights' square roots, columns of weight 0 left out, so that memory and time fall
/// with them, and the scale is taken off the eigenvectors again, which are then not orthonormal.
///
/// A column without weight gets what the rows' weights explain of it in the least squares: rows of
/// a cluster have uncorrelated weights, so for each component sum(weight * value) / sum(weight^2),
/// 0 where the latter is 0. It is cut to the largest magnitude that the component has in the
/// others, so that what nobody asks for costs no precision where a component is stored in steps of
/// its range. Defined for any finite data.
///
/// @param weights  of the columns of every part, which all have as many; 0 or at least 1e-8, the
/// largest 1. Empty: all alike, which is fit_local_pca() itself.
[[nodiscard]] LocalPca fit_weighted_pca(const RowSource& source,
                                        std::span<const float> weights,
                                        const LocalPcaOptions& options,
                                        Progress& progress,
                                        Communicator& ranks = alone());

}  // namespace veneer::btf
