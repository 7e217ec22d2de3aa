// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/lut3d/tetrahedral_lut.h"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/result.h"

namespace veneer::calibration {

TetrahedralLut::TetrahedralLut(std::array<std::vector<double>, 3> axes, std::vector<Xyz> values)
    : axes_(std::move(axes)), values_(std::move(values)) {
  const std::size_t n = axes_[0].size();
  for (const std::vector<double>& axis : axes_) {
    VENEER_CHECK(axis.size() == n && n >= 2 && axis.front() == 0.0 && axis.back() == 1.0);
    VENEER_CHECK(std::ranges::adjacent_find(axis, std::ranges::greater_equal{}) == axis.end());
  }
  VENEER_CHECK(values_.size() == n * n * n);
  VENEER_CHECK(std::ranges::all_of(values_, [](const Xyz& xyz) { return xyz.allFinite(); }));
}

const Xyz& TetrahedralLut::value(const std::array<std::size_t, 3>& node) const {
  const std::size_t n = axes_[0].size();
  return values_[(node[2] * n + node[1]) * n + node[0]];
}

double TetrahedralLut::side(const std::array<std::size_t, 3>& cell, std::size_t axis) const {
  return axes_[axis][cell[axis] + 1] - axes_[axis][cell[axis]];
}

TetrahedralLut::Corner TetrahedralLut::corner_of(const Eigen::Vector3d& linear) const {
  Corner corner;
  for (std::size_t c = 0; c < 3; ++c) {
    const double at = std::clamp(linear[static_cast<Eigen::Index>(c)], 0.0, 1.0);
    const auto after = std::ranges::upper_bound(axes_[c], at) - axes_[c].begin();
    corner.cell[c] = std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(after - 1, 0)),
                              axes_[c].size() - 2);
    corner.part[static_cast<Eigen::Index>(c)] =
        (at - axes_[c][corner.cell[c]]) / side(corner.cell, c);
  }
  corner.order = {0, 1, 2};
  std::ranges::sort(corner.order, [&corner](std::size_t a, std::size_t b) {
    return corner.part[static_cast<Eigen::Index>(a)] > corner.part[static_cast<Eigen::Index>(b)];
  });
  return corner;
}

Xyz TetrahedralLut::operator()(const Eigen::Vector3d& linear) const {
  if (linear.hasNaN()) return Xyz::Constant(std::nan(""));
  const Corner corner = corner_of(linear);
  std::array<std::size_t, 3> node = corner.cell;
  Xyz xyz = value(node);
  for (const std::size_t axis : corner.order) {
    const Xyz& from = value(node);
    ++node[axis];
    xyz += corner.part[static_cast<Eigen::Index>(axis)] * (value(node) - from);
  }
  return xyz;
}

Eigen::Matrix3d TetrahedralLut::slope_at(const Eigen::Vector3d& linear) const {
  if (linear.hasNaN()) return Eigen::Matrix3d::Constant(std::nan(""));
  const Corner corner = corner_of(linear);
  std::array<std::size_t, 3> node = corner.cell;
  Eigen::Matrix3d slope;
  for (const std::size_t axis : corner.order) {
    const Xyz& from = value(node);
    ++node[axis];
    slope.col(static_cast<Eigen::Index>(axis)) = (value(node) - from) / side(corner.cell, axis);
  }
  return slope;
}

std::optional<Eigen::Vector3d> TetrahedralLut::inverse(const Xyz& xyz) const {
  if (!xyz.allFinite()) return std::nullopt;
  // Of a cell's sides: colours on a face shared by two tetrahedra must not fall between them.
  constexpr double kOnFace = 1e-9;
  const std::size_t cells = axes_[0].size() - 1;
  for (std::size_t i = 0; i < cells * cells * cells; ++i) {
    const std::array<std::size_t, 3> cell{i % cells, i / cells % cells, i / (cells * cells)};
    std::array<std::size_t, 3> order{0, 1, 2};
    do {
      std::array<std::size_t, 3> node = cell;
      Eigen::Matrix3d steps;
      for (Eigen::Index k = 0; k < 3; ++k) {
        const Xyz& from = value(node);
        ++node[order[static_cast<std::size_t>(k)]];
        steps.col(k) = value(node) - from;
      }
      const Eigen::Vector3d part = steps.inverse() * (xyz - value(cell));  // not finite if flat
      if (!(part[0] <= 1.0 + kOnFace && part[1] <= part[0] + kOnFace &&
            part[2] <= part[1] + kOnFace && part[2] >= -kOnFace))
        continue;
      Eigen::Vector3d linear;
      for (Eigen::Index k = 0; k < 3; ++k) {
        const std::size_t axis = order[static_cast<std::size_t>(k)];
        linear[static_cast<Eigen::Index>(axis)] =
            axes_[axis][cell[axis]] + std::clamp(part[k], 0.0, 1.0) * side(cell, axis);
      }
      return linear;
    } while (std::ranges::next_permutation(order).found);
  }
  return std::nullopt;
}

}  // namespace veneer::calibration
