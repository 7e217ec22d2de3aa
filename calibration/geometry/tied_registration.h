// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "base/result.h"
#include "calibration/geometry/board.h"
#include "calibration/geometry/lens.h"
#include "calibration/geometry/registration.h"
#include "tracking/synchronised.h"

namespace veneer::geometry {

struct TiedOptions {
  /// How far the board's points lie from where the lens says, standard deviation; the fit of the
  /// geometry tells. Above 0.
  double pixel_deviation_px = 0.1;
  /// How well a person hits the middle of a cross-hair. Above 0.
  double touch_deviation_px = 0.5;
  [[nodiscard]] Status check() const;  ///< Errors: kInvalidOption
};

struct TiedRegistration {
  RigidTransform world_from_projector;
  RigidTransform board_from_sensor;
  /// Root mean square distance, in projector pixels, from where the board's points were seen to
  /// where the tracker's poses alone put them; of the poses that were used.
  double rms_px = 0;
  double held_out_px = 0;  ///< the same, each pose predicted by a fit of the others
  /// Root mean square distance of the touched cross-hairs from where they were shown; 0 without.
  double touch_rms_px = 0;
  double position_deviation_m = 0;  ///< of world_from_projector's origin, largest coordinate
  double rotation_deviation_rad = 0;
};

/// Refines a registration over the pixels themselves. A board's pose as the projector sees it is
/// known far better across the line of sight than along it, which register_boards() cannot use: it
/// takes a pose's coordinates as equally good. Here the unknowns are the two frames and, for every
/// pose, the tracker's error, which is held near 0 by its own deviation:
///   pixel = lens(projector_from_world * world_from_sensor * error * sensor_from_board * point).
/// Cross-hairs that the projector shows on the scene and a person touches tie the picture to the
/// world right where it is wanted; they go through the same lens, robustly, since a hand slips.
/// @param views  of the board, with the projector's pixels; one a pose.
/// @param sensors  world_from_sensor of the same poses, with their deviations.
/// @param start  of the same poses; what it calls outliers is left out.
/// @param touches  may be none.
/// Errors: kInvalidOption (options; numbers of poses that differ), kBadFormat (fewer than 4
/// inliers; no point in front of the projector, or no convergence).
[[nodiscard]] Result<TiedRegistration> tie_registration(
    std::span<const View> views,
    std::span<const tracking::SynchronisedPose> sensors,
    const Lens& lens,
    const BoardRegistration& start,
    std::span<const PixelTouch> touches = {},
    const TiedOptions& options = {});

}  // namespace veneer::geometry
