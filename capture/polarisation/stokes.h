// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <span>

#include "base/result.h"

namespace veneer::capture {

/// Linear Stokes parameters S0, S1, S2 with respect to the analyser's axis at angle 0; positive S2
/// at 45 degrees counter-clockwise for who looks at the sample from the camera. In the unit of the
/// readings of a perfect analyser, which passes (S0 + S1 cos 2a + S2 sin 2a) / 2.
using LinearStokes = Eigen::Vector3d;

/// Least squares from readings behind analysers at three or more different angles.
class StokesSolver {
 public:
  /// @param extinction  Imax / Imin of the analyser, above 1; infinity is a perfect one.
  /// Errors: kInvalidOption (angles that do not span or nearly so, which is where noise would be
  /// amplified more than a hundred times; an extinction that is not above 1).
  [[nodiscard]] static Result<StokesSolver> create(std::span<const double> angles_rad,
                                                   double extinction);
  /// @param readings  one for each angle. What is no number stays none.
  [[nodiscard]] LinearStokes solve(std::span<const double> readings) const;
  /// The readings' covariance is diag(variance): that of the parameters.
  [[nodiscard]] Eigen::Matrix3d covariance(std::span<const double> variance) const;
  /// Root mean square of what the fit leaves; 0 for three angles.
  [[nodiscard]] double residual(std::span<const double> readings, const LinearStokes& stokes) const;

 private:
  explicit StokesSolver(Eigen::MatrixXd forward);
  Eigen::MatrixXd forward_;  // [angles x 3]
  Eigen::MatrixXd inverse_;  // [3 x angles]
};

/// sqrt(S1^2 + S2^2) / S0; 0 where S0 <= 0 or is no number. Noise can bring it above 1; it is not
/// cut.
[[nodiscard]] double degree_of_polarisation(const LinearStokes& stokes);
/// Half the azimuth of (S1, S2), radians in [0, pi); 0 for unpolarised light.
[[nodiscard]] double angle_of_polarisation(const LinearStokes& stokes);

}  // namespace veneer::capture
