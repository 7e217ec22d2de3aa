// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "btf/models/local_pca.h"
#include "btf/spherical_interpolation.h"

namespace veneer::btf {

/// The nodes of a square grid, and their weights, that make up the value at a direction: bilinear
/// on the square of the elevated concentric map. Node (column, row) has index row * nodes + column.
struct GridWeights {
  std::array<int, 4> node{};
  std::array<double, 4> weight{};
};

/// A square grid of nodes x nodes over the elevated concentric map, the first and last on the
/// square's border (the horizon), and the linear operator that fills it from values at measured
/// directions.
///
/// Values are chosen so that what is drawn between the nodes comes closest, in the mean square over
/// the hemisphere, to the SphericalInterpolator's result, with the measured directions
/// weighing more; nodes that sampled it would cut off peaks, which seldom lie on a node. A light's
/// nodes on the horizon are 0. Sets of one view need, and get, one node. Thread-safe.
class AngularGrid {
 public:
  /// @param nodes  of a side, >= 2.
  AngularGrid(const DirectionSet& directions, DirectionRole role, int nodes);
  [[nodiscard]] int nodes() const { return nodes_; }
  [[nodiscard]] GridWeights weights(const Direction& direction) const;
  /// [nodes * nodes][directions]: node values = fill() * values at the directions.
  [[nodiscard]] const RowMatrix& fill() const { return fill_; }

 private:
  int nodes_;
  RowMatrix fill_;
};

}  // namespace veneer::btf
