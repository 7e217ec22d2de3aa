// SPDX-License-Identifier: Apache-2.0
#include "btf/models/angular_grid.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <algorithm>
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

}  // namespace

AngularGrid::AngularGrid(const DirectionSet& directions, DirectionRole role, int nodes)
    : nodes_(directions.size() == 1 && role == DirectionRole::kView ? 1 : nodes) {
  const auto count = static_cast<Eigen::Index>(directions.size());
  if (nodes_ == 1) {
    fill_ = RowMatrix::Ones(1, 1);
    return;
  }
  VENEER_CHECK(nodes_ >= 2);
  const SphericalInterpolator reference(directions, role);
  const int size = nodes_ * nodes_;

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
  const int samples = kSamplesPerCell * (nodes_ - 1);
  for (int row = 0; row < samples; ++row)
    for (int column = 0; column < samples; ++column) {
      const Direction d = direction_from_square({(column + 0.5) / samples, (row + 0.5) / samples});
      add(weights(d), reference.weights(d), 1.0);
    }
  for (const Direction& d : directions) add(weights(d), reference.weights(d), kMeasuredWeight);
  for (int node = 0; node < size; ++node) {
    const int column = node % nodes_;
    const int row = node / nodes_;
    const bool border = column == 0 || row == 0 || column == nodes_ - 1 || row == nodes_ - 1;
    const GridWeights here{{node, node, node, node}, {1.0, 0.0, 0.0, 0.0}};
    if (border && role == DirectionRole::kLight) {
      // Stiff enough that 0 is met within float16 whatever the neighbours want.
      add(here, {.index = {0, 0, 0}, .weight = {0.0, 0.0, 0.0}, .scale = 0.0}, 1e8);
    } else {
      const Direction d =
          direction_from_square({double(column) / (nodes_ - 1), double(row) / (nodes_ - 1)});
      add(here, reference.weights(d), kNodeWeight);
    }
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(normal.begin(), normal.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  VENEER_CHECK(solver.info() == Eigen::Success);  // positive definite by the nodes' own terms
  fill_ = solver.solve(right).cast<float>();
}

GridWeights AngularGrid::weights(const Direction& direction) const {
  if (nodes_ == 1) return {{0, 0, 0, 0}, {1.0, 0.0, 0.0, 0.0}};
  const Eigen::Vector2d st = (nodes_ - 1) * concentric_square(direction);
  const int column = std::clamp(static_cast<int>(st.x()), 0, nodes_ - 2);
  const int row = std::clamp(static_cast<int>(st.y()), 0, nodes_ - 2);
  const double u = st.x() - column;
  const double v = st.y() - row;
  const int first = row * nodes_ + column;
  return {{first, first + 1, first + nodes_, first + nodes_ + 1},
          {(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v}};
}

}  // namespace veneer::btf
