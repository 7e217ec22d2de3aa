// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <vector>

#include "base/result.h"
#include "calibration/colour/colour_model.h"
#include "calibration/colour_residual.h"

namespace veneer::calibration {

/// A colour model as ProjectorProfile keeps it: F(d) = M (t(d) + rho(t(d))).
struct BakedColour {
  /// Per channel, 2^bits values: t of every code, not falling, t[0] = 0, t[last] = 1.
  std::array<std::vector<double>, 3> tone_curves;
  Eigen::Matrix3d primaries = Eigen::Matrix3d::Identity();  ///< M: XYZ of R, G, B at full drive
  /// Empty for an additive model whose channels keep their chromaticity.
  ColourResidual residual;

  /// F of a linear drive t in [0, 1]^3: XYZ above black, as the model's.
  [[nodiscard]] Xyz forward(const Eigen::Vector3d& linear_drive) const {
    return primaries * (linear_drive + residual(linear_drive));
  }
};

/// Nodes along each axis of a residual. 33 keep drift, crosstalk and a white segment to 0.05 dE00
/// at 95 % of drives and to 0.2 at most (baking_test.cc).
inline constexpr int kResidualNodes = 33;

/// Tabulates a model.
///
/// The tone curve of a channel is what its light contributes along the channel's own primary at
/// full drive, when it is decomposed into the three primaries, made not to fall; what then is
/// missing (the other two components, and what channels do to each other) is the residual.
/// @param bits  of a drive code, 1 to 16.
/// Errors: kInvalidOption (bits); kBadFormat (two primaries of the same colour, a model that is not
/// finite or whose channel does not rise).
[[nodiscard]] Result<BakedColour> bake(const ColourModel& model, int bits);

}  // namespace veneer::calibration
