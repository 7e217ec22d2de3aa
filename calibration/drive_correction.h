// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "calibration/colour_residual.h"

namespace veneer::calibration {

/// The linear drive tau with tau + rho(tau) = wanted, where rho is constant beyond the cube
/// [0, 1]^3 along each axis: a wanted drive is out of gamut where tau leaves the cube.
///
/// Newton's method with slopes over a piece of the grid, so that creases do not mislead it; a step
/// is halved until it brings the sum nearer, and tau keeps within the largest |rho| of `wanted`. It
/// ends at the best point found: for a rho that profiles may have (ProjectorProfile::check), within
/// 1e-9 but for the first cell above black, where the grid's own form is not always invertible
/// (there within 1e-5); for others, somewhere finite.
/// @param wanted  finite.
[[nodiscard]] Eigen::Vector3d solve_drive(const ColourResidual& rho, const Eigen::Vector3d& wanted);

/// The inverse of t -> t + rho(t) as a table that a shader can read: the correction tau - t* over
/// the wanted linear drive t* = M^-1 XYZ.
///
/// Along each axis, node i lies at full * s|s| with s = (i - below) / steps: node `below` is black
/// and node `below + steps` full drive, so that both are met exactly and the dark is dense. `full`
/// is t* of full drive. Some nodes lie below 0 and some above `full`, as many as it takes to cover
/// all that the projector can send (a primary that drifts leaves M's cone). Between nodes the
/// correction is linear on tetrahedra in s, as ColourResidual is: creases of rho on the planes
/// where two channels are equal stay on faces of tetrahedra. Outside, it is that of the nearest
/// point of the grid, so that tau goes on growing with t* and leaves [0, 1] where the wanted drive
/// is out of gamut, as for solve_drive.
class DriveCorrection {
 public:
  /// Nodes along each axis: with these, an in-gamut target is met within 0.05 dE00 in the mean and
  /// 0.3 at most for a white segment of a quarter, 5 % of crosstalk and 6 % of drift
  /// (drive_correction_test.cc).
  static constexpr int kNodes = 41;

  struct Axes {
    Eigen::Vector3d full = Eigen::Vector3d::Ones();  ///< t* of node below + steps, positive
    int steps = 1;                                   ///< from black to full drive
    int below = 0;                                   ///< nodes below black
  };

  /// No correction: tau = t*.
  DriveCorrection() = default;
  /// None where rho is empty. Takes about a tenth of a second.
  /// @param nodes  5 to 129 (checked).
  explicit DriveCorrection(const ColourResidual& rho, int nodes = kNodes);

  [[nodiscard]] bool empty() const { return corrections_.empty(); }
  [[nodiscard]] int nodes() const { return corrections_.nodes(); }
  [[nodiscard]] const Axes& axes() const { return axes_; }
  /// tau - t* of node (r, g, b) at index (b * nodes + g) * nodes + r.
  [[nodiscard]] const std::vector<Eigen::Vector3d>& values() const { return corrections_.values(); }

  /// tau for a wanted linear drive; NaN for NaN.
  [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& wanted) const;

 private:
  Axes axes_;
  // Over (i / (nodes - 1))^2 along each axis: a grid of the same kind, whose root is taken again
  // there.
  ColourResidual corrections_;
};

}  // namespace veneer::calibration
