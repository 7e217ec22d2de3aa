// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <functional>
#include <vector>

namespace veneer::calibration {

/// rho in F(d) = M (t(d) + rho(t(d))): what one matrix M and three tone curves t leave of a
/// projector's colour: drift of the primaries, crosstalk, a white segment.
///
/// A grid over the linear drive t in [0, 1]^3, nodes at t = (i / (n - 1))^2, so that it is denser
/// in the dark. Between nodes it is linear on tetrahedra in sqrt(t) (Kasson, Nin, Plouffe and
/// Hafner 1995, "Performing Color Space Conversions with Three-Dimensional Linear Interpolation"),
/// whose faces are the planes t_i = t_j: what depends on the least of the channels, as a white
/// segment does, has its creases there. Beyond the cube it is what it is at the nearest point of
/// the cube.
class ColourResidual {
 public:
  /// rho = 0 everywhere.
  ColourResidual() = default;
  /// @param values  of node (r, g, b) at index (b * nodes + g) * nodes + r; finite, nodes^3 of them
  ///                (checked).   @param nodes  along each axis, 2 to 129 (checked).
  ColourResidual(int nodes, std::vector<Eigen::Vector3d> values);
  /// Of a function of the linear drive in [0, 1]^3.
  [[nodiscard]] static ColourResidual sampled(
      int nodes, const std::function<Eigen::Vector3d(const Eigen::Vector3d& drive)>& rho);

  [[nodiscard]] bool empty() const { return values_.empty(); }
  [[nodiscard]] int nodes() const { return nodes_; }
  [[nodiscard]] const std::vector<Eigen::Vector3d>& values() const { return values_; }

  /// rho at a linear drive; NaN for NaN.
  [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& drive) const;

 private:
  int nodes_ = 0;
  std::vector<Eigen::Vector3d> values_;
};

}  // namespace veneer::calibration
