// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "btf/fit_region.h"
#include "btf/models/local_pca.h"
#include "btf/spherical_interpolation.h"

namespace veneer::btf {

/// The nodes of a square grid, and their weights, that make up the value at a direction: bilinear
/// on the square of the elevated concentric map. Node (column, row) has index row * columns +
/// column.
struct GridWeights {
  std::array<int, 4> node{};
  std::array<double, 4> weight{};
};

/// Where the nodes of a grid lie: in a box on the square of the elevated concentric map, the first
/// and the last along each side on the box's border; a single one in the middle.
struct GridShape {
  DirectionBox box;
  int columns = 1;  ///< nodes along u
  int rows = 1;     ///< nodes along v

  /// As dense as `angular` nodes along the whole square; at least two along a side, but one where
  /// the side is no longer than kPointSide. Sets of one view need, and get, one node.
  [[nodiscard]] static GridShape of(const DirectionSet& directions,
                                    DirectionRole role,
                                    const DirectionBox& box,
                                    int angular);
  [[nodiscard]] int count() const { return columns * rows; }
  /// Nodes between those at the border, [column, row] in fractions: the place of a direction,
  /// clamped to the grid. What cluster_volume.glsl does.
  [[nodiscard]] Eigen::Vector2d place(const Direction& direction) const;
  /// Nodes for each unit of the square along u and v; 0 along a side of one node.
  [[nodiscard]] Eigen::Vector2d scale() const;
  /// The point of the square where a node lies.
  [[nodiscard]] Eigen::Vector2d node(int column, int row) const;

  /// Twice what the shader's map is off (kConcentricSquareError): a sixth of a degree.
  static constexpr double kPointSide = 1e-3;
};

/// A grid of nodes on a box of the elevated concentric map, all of it where the border is the
/// horizon, and the linear operator that fills it from values at measured directions.
///
/// Values are chosen so that what is drawn between the nodes comes closest, in the mean square over
/// the box, to the SphericalInterpolator's result, with the measured directions
/// weighing more; nodes that sampled it would cut off peaks, which seldom lie on a node. A light's
/// nodes on the horizon are 0. Directions outside the box are those of its border. Thread-safe.
class AngularGrid {
 public:
  AngularGrid(const DirectionSet& directions, DirectionRole role, const GridShape& shape);
  /// The whole square. @param nodes  of a side, >= 2.
  AngularGrid(const DirectionSet& directions, DirectionRole role, int nodes)
      : AngularGrid(directions, role, GridShape::of(directions, role, {}, nodes)) {}
  [[nodiscard]] const GridShape& shape() const { return shape_; }
  [[nodiscard]] GridWeights weights(const Direction& direction) const;
  /// [node][directions]: node values = fill() * values at the directions.
  [[nodiscard]] const RowMatrix& fill() const { return fill_; }

 private:
  GridShape shape_;
  RowMatrix fill_;
};

}  // namespace veneer::btf
