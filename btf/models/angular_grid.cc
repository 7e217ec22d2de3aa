// SPDX-License-Identifier: Apache-2.0
#include "btf/models/angular_grid.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/result.h"
#include "btf/elevated_concentric.h"
#include "btf/models/concentric_square.h"

namespace veneer::btf {
namespace {

// Directions per grid cell and side at which the grid is compared with the reference.
constexpr int kSamplesPerCell = 4;
// Weight of a measured direction against one of those: the tables of the literature look only at
// measured directions, an observer at all.
constexpr double kMeasuredWeight = 16.0;
// Pull of a node to the reference's own value there, which decides for nodes that nothing else
// does.
constexpr double kNodeWeight = 1e-3;

// Places between the nodes along a side; its only one where there is one node.
int samples_along(int nodes) { return nodes == 1 ? 1 : kSamplesPerCell * (nodes - 1); }

bool is_inside(const DirectionBox& box, const Direction& direction) {
  const Eigen::Vector2d at = square_from_direction(direction);
  constexpr double kBorder = GridShape::kPointSide;
  return at.x() >= box.u_min - kBorder && at.x() <= box.u_max + kBorder &&
         at.y() >= box.v_min - kBorder && at.y() <= box.v_max + kBorder;
}

}  // namespace

GridShape GridShape::of(const DirectionSet& directions,
                        DirectionRole role,
                        const DirectionBox& box,
                        int angular) {
  if (directions.size() == 1 && role == DirectionRole::kView) return {box, 1, 1};
  const auto nodes = [angular](double side) {
    if (side <= kPointSide) return 1;
    // A hair less, so that rounding adds no node.
    return std::max(2, static_cast<int>(std::ceil(angular * side - 1e-9)));
  };
  return {box, nodes(box.u_max - box.u_min), nodes(box.v_max - box.v_min)};
}

Eigen::Vector2d GridShape::scale() const {
  return {columns == 1 ? 0.0 : (columns - 1) / (box.u_max - box.u_min),
          rows == 1 ? 0.0 : (rows - 1) / (box.v_max - box.v_min)};
}

Eigen::Vector2d GridShape::place(const Direction& direction) const {
  const Eigen::Vector2d at =
      (concentric_square(direction) - Eigen::Vector2d(box.u_min, box.v_min)).cwiseProduct(scale());
  return at.cwiseMax(0.0).cwiseMin(Eigen::Vector2d(columns - 1, rows - 1));
}

Eigen::Vector2d GridShape::node(int column, int row) const {
  const auto along = [](double from, double to, int i, int nodes) {
    if (nodes == 1) return 0.5 * (from + to);
    return i == nodes - 1 ? to : from + (to - from) * i / (nodes - 1);
  };
  return {along(box.u_min, box.u_max, column, columns), along(box.v_min, box.v_max, row, rows)};
}

AngularGrid::AngularGrid(const DirectionSet& directions, DirectionRole role, const GridShape& shape)
    : shape_(shape) {
  const auto count = static_cast<Eigen::Index>(directions.size());
  if (count == 1 && role == DirectionRole::kView) {
    VENEER_CHECK(shape_.count() == 1);
    fill_ = RowMatrix::Ones(1, 1);
    return;
  }
  const SphericalInterpolator reference(directions, role);
  const int size = shape_.count();

  // Normal equations of min sum_m w_m |grid(d_m) - reference(d_m)|^2; the right side has one column
  // for each measured direction, since the reference is linear in their values.
  std::vector<Eigen::Triplet<double>> normal;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(size, count);
  const auto add = [&](const GridWeights& grid, const DirectionWeights& wanted, double weight) {
    for (std::size_t i = 0; i < 4; ++i) {
      if (grid.weight[i] == 0.0) continue;
      const double scaled = weight * grid.weight[i];
      for (std::size_t j = 0; j < 4; ++j)
        if (grid.weight[j] != 0.0)
          normal.emplace_back(grid.node[i], grid.node[j], scaled * grid.weight[j]);
      for (std::size_t j = 0; j < 3; ++j)
        right(grid.node[i], wanted.index[j]) += scaled * wanted.scale * wanted.weight[j];
    }
  };
  const DirectionBox& box = shape_.box;
  const int columns = samples_along(shape_.columns);
  const int rows = samples_along(shape_.rows);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const Direction d =
          direction_from_square({box.u_min + (box.u_max - box.u_min) * (column + 0.5) / columns,
                                 box.v_min + (box.v_max - box.v_min) * (row + 0.5) / rows});
      add(weights(d), reference.weights(d), 1.0);
    }
  for (const Direction& d : directions)
    if (is_inside(box, d)) add(weights(d), reference.weights(d), kMeasuredWeight);
  for (int node = 0; node < size; ++node) {
    const Eigen::Vector2d at = shape_.node(node % shape_.columns, node / shape_.columns);
    const bool horizon = at.minCoeff() <= 0.0 || at.maxCoeff() >= 1.0;
    const GridWeights here{{node, node, node, node}, {1.0, 0.0, 0.0, 0.0}};
    if (horizon && role == DirectionRole::kLight) {
      // Stiff enough that 0 is met within float16 whatever the neighbours want.
      add(here, {.index = {0, 0, 0}, .weight = {0.0, 0.0, 0.0}, .scale = 0.0}, 1e8);
    } else {
      add(here, reference.weights(direction_from_square(at)), kNodeWeight);
    }
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(normal.begin(), normal.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  VENEER_CHECK(solver.info() == Eigen::Success);  // positive definite by the nodes' own terms
  fill_ = solver.solve(right).cast<float>();
}

GridWeights AngularGrid::weights(const Direction& direction) const {
  const Eigen::Vector2d st = shape_.place(direction);
  const int column = std::clamp(static_cast<int>(st.x()), 0, std::max(shape_.columns - 2, 0));
  const int row = std::clamp(static_cast<int>(st.y()), 0, std::max(shape_.rows - 2, 0));
  const double u = st.x() - column;
  const double v = st.y() - row;
  // Along a side of one node the neighbour is the node itself, with weight 0.
  const int first = row * shape_.columns + column;
  const int right = shape_.columns > 1 ? 1 : 0;
  const int below = shape_.rows > 1 ? shape_.columns : 0;
  return {{first, first + right, first + below, first + below + right},
          {(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v}};
}

}  // namespace veneer::btf
