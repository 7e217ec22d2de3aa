// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace veneer::geometry {

/// Which measurements agree with a hypothesis, from their distances in deviations of each.
struct Agreement {
  double median = 0;         ///< of the distances
  double scatter = 1;        ///< by how much the measurements are worse than their deviations say
  std::vector<bool> inlier;  ///< closer than `most_deviations` times `scatter`
  int inliers = 0;
};

/// @param usual_median  that the distances have if the deviations are right.
[[nodiscard]] Agreement agreement_of(std::span<const double> distances,
                                     double usual_median,
                                     double most_deviations);

/// Subsets of `size` out of `count`, all of them or, where these are too many, as many as suffice
/// to hit upon one without outliers; the same on every run.
[[nodiscard]] std::vector<std::vector<std::size_t>> subsets_of(std::size_t count, std::size_t size);

/// The hypothesis with the least median of distances: it holds with nearly half of the measurements
/// wrong. Source: Rousseeuw 1984, "Least Median of Squares Regression".
/// @param hypothesis  from a subset; absent where that is degenerate.
template <class Model>
[[nodiscard]] std::optional<Model> least_median(
    std::size_t count,
    std::size_t subset_size,
    const std::function<std::optional<Model>(std::span<const std::size_t>)>& hypothesis,
    const std::function<std::vector<double>(const Model&)>& distances) {
  std::optional<Model> best;
  double least = 0;
  for (const std::vector<std::size_t>& subset : subsets_of(count, subset_size)) {
    const std::optional<Model> model = hypothesis(subset);
    if (!model) continue;
    const double median = agreement_of(distances(*model), 1, 1).median;
    if (best && !(median < least)) continue;
    best = model;
    least = median;
  }
  return best;
}

/// Root mean squares of points about their middle along their own axes, largest first.
[[nodiscard]] Eigen::Vector3d extents_of(std::span<const Eigen::Vector3d> points);

}  // namespace veneer::geometry
