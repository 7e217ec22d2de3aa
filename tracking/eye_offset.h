// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstddef>

#include "base/result.h"
#include "tracking/pose_history.h"

namespace veneer::tracking {

/// Where the eye lies in the frame of the sensor that the head wears.
///
/// Measured from a history in which the eye stayed in one place (at a peephole, or where two marks
/// cover each other) while the head turned about it: then R t + p, the eye in the world, is the
/// same for every pose (R, p), and both t and the eye follow by linear least squares. Turning about
/// one axis alone leaves t along that axis unknown: the head must nod as well as shake or tilt.
///
/// Source: Yaniv 2015, "Which pivot calibration?", Proc. SPIE 9415.
struct EyeOffset {
  Eigen::Vector3d eye_in_sensor = Eigen::Vector3d::Zero();  ///< metres
  Eigen::Vector3d eye_in_world = Eigen::Vector3d::Zero();   ///< metres
  /// Of eye_in_sensor, m^2: how it varies when tenths of the session are left out in turn. Unlike
  /// what independent noise would give, it counts that the eye wandered.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  /// How far the eye was from its place by the poses that were used, rms.
  double residual_m = 0;
  /// The same for each tenth of the session by what the other nine say.
  double held_out_m = 0;
  /// How far the head turned about the axis of most turning, the next and the last, at right angles
  /// to each other: from the 2nd to the 98th percentile, degrees.
  Eigen::Vector3d span_deg = Eigen::Vector3d::Zero();
  std::size_t used = 0;
  std::size_t outliers = 0;  ///< left out

  /// The standard deviation of eye_in_sensor in its worst direction, metres.
  [[nodiscard]] double deviation_m() const;
};

/// What a measurement must reach to be believed.
struct EyeOffsetLimits {
  /// About the second axis. A tracker's noise is far smaller; but over fewer degrees an eye that
  /// wanders by d passes for an offset that is wrong by more than d / 10 degrees in radians = 6 d.
  double least_span_deg = 10;
  double most_residual_m = 0.003;   ///< the eye did not stay in its place
  double most_deviation_m = 0.002;  ///< of eye_in_sensor; seen from 1 m, a tenth of a degree
  double most_outliers = 0.3;       ///< of all
};

/// Errors: kBadFormat for fewer than 50 poses. However badly the offset is known it is told: see
/// check().
[[nodiscard]] Result<EyeOffset> measure_eye_offset(const PoseHistory& history);

/// Whether the measurement may be used. Errors: kUnavailable, which says what fell short of which
/// limit and what to do.
[[nodiscard]] Status check(const EyeOffset& offset, const EyeOffsetLimits& limits);

}  // namespace veneer::tracking
