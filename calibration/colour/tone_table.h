// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <vector>

#include "base/result.h"
#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// The tone curves that a model implies: what each channel alone has along its own primary.
struct ToneTable {
  /// Per channel, at equally spaced drives from 0 to 1: not falling, 0 at 0 and 1 at 1.
  std::array<std::vector<double>, 3> curves;
  Eigen::Matrix3d primaries = Eigen::Matrix3d::Identity();        ///< XYZ at full drive
  Eigen::Matrix3d linear_from_xyz = Eigen::Matrix3d::Identity();  ///< its inverse

  /// The drive at which the curves, straight between their values, are `linear`; on a flat piece
  /// its lower end.   @param linear  clamped to [0, 1].
  [[nodiscard]] Eigen::Vector3d drive_of(const Eigen::Vector3d& linear) const;
};

/// @param size  values a channel, at least 2 (checked).
/// Errors: kBadFormat (two primaries of the same colour; a model that is not finite).
[[nodiscard]] Result<ToneTable> tone_table(const ColourModel& model, int size);

}  // namespace veneer::calibration
