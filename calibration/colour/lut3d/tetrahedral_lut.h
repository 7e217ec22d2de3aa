// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "base/colour.h"

namespace veneer::calibration {

/// XYZ over a cube of linear drives, linear on the six tetrahedra of every cell that share its
/// diagonal from dark to bright (Kasson, Nin, Plouffe and Hafner 1995, "Performing Color Space
/// Conversions with Three-Dimensional Linear Interpolation").
class TetrahedralLut {
 public:
  /// @param axes  the nodes of each channel: as many for all, strictly rising from 0 to 1
  /// (checked).
  /// @param values  of node (r, g, b) at (b * n + g) * n + r; finite, n^3 (checked).
  TetrahedralLut(std::array<std::vector<double>, 3> axes, std::vector<Xyz> values);

  [[nodiscard]] int nodes() const { return static_cast<int>(axes_[0].size()); }
  /// @param linear  in [0, 1]^3; clamped.
  [[nodiscard]] Xyz operator()(const Eigen::Vector3d& linear) const;
  /// d XYZ / d linear in the tetrahedron that operator() uses there.
  [[nodiscard]] Eigen::Matrix3d slope_at(const Eigen::Vector3d& linear) const;
  /// A linear drive in the cube that gives `xyz`: exact, by looking into every tetrahedron, so that
  /// it ends whatever the values. Where several give it, the one in the first cell. Nothing where
  /// none does, or for NaN.
  [[nodiscard]] std::optional<Eigen::Vector3d> inverse(const Xyz& xyz) const;

 private:
  struct Corner {
    std::array<std::size_t, 3> cell{};
    std::array<std::size_t, 3> order{};  ///< axes, the one along which the point is farthest first
    Eigen::Vector3d part;                ///< of the cell's sides
  };
  [[nodiscard]] Corner corner_of(const Eigen::Vector3d& linear) const;
  [[nodiscard]] const Xyz& value(const std::array<std::size_t, 3>& node) const;
  [[nodiscard]] double side(const std::array<std::size_t, 3>& cell, std::size_t axis) const;

  std::array<std::vector<double>, 3> axes_;
  std::vector<Xyz> values_;
};

}  // namespace veneer::calibration
