// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "base/result.h"
#include "capture/development/rectification.h"

namespace veneer::capture {

/// What the highlight of a polished ball says of the light.
struct BallReading {
  Eigen::Vector3d light = Eigen::Vector3d::UnitZ();  ///< direction to it, local frame, unit
  Eigen::Vector2d centre_px{0, 0};                   ///< of the ball in the picture
  double radius_px = 0;
  Eigen::Vector2d highlight_px{0, 0};
  double deviation_rad = 0;  ///< what an error of 0.5 px of centre and highlight makes (1.5 px
                             ///< where the rim does not mirror the board)
};

/// The ball lies on the board and mirrors it in its rim. The direction is the one from the ball: of
/// a near light it is not quite that from the sample.
/// Finds the ball's outline and its brightest spot, and takes the mirror direction at the normal
/// there, with the camera's perspective.
/// @param plane  pose of the board beside which the ball lies.   @param ball_radius_mm
/// Errors: kNotFound (no round outline, no highlight: the text says what to do).
[[nodiscard]] Result<BallReading> read_mirror_ball(const MergedPicture& picture,
                                                   const PlaneView& plane,
                                                   double ball_radius_mm);

}  // namespace veneer::capture
