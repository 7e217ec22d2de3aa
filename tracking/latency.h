// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "base/clock.h"
#include "base/result.h"
#include "tracking/pose_history.h"

namespace veneer::tracking {

struct LatencyOptions {
  /// Latencies from minus to plus this are tried. Over 0, at most 2.
  double most_s = 0.25;
  /// Both histories are smoothed over so long to either side, alike, so that neither noise nor the
  /// place of a moment between two samples pulls at the result. At least four samples of the slower
  /// tracker have to fit. Over 0, at most 0.5.
  double smoothing_s = 0.025;
};

/// By what the two motions were compared.
enum class MotionSignal { kPosition, kRotation };
[[nodiscard]] std::string_view name_of(MotionSignal signal);

/// How much later a tracker tells of a motion than a reference that saw the same motion.
struct Latency {
  /// Add it to the tracker's `latency_ms`; below 0 where the tracker is ahead of the reference.
  double latency_s = 0;
  /// Standard deviation, by leaving out tenths of the recording in turn.
  double deviation_s = 0;
  MotionSignal signal = MotionSignal::kPosition;  ///< the one that tells more
  /// What is left between the motions at this latency: metres or radians, rms.
  double residual = 0;
  /// And at the latency of those tried that fits worst.
  double worst_residual = 0;
  /// The other latency that fits best, where the motion repeats itself; and how well that fits.
  std::optional<double> rival_residual;
  bool at_edge = false;  ///< it is the farthest that was tried
  double seconds = 0;    ///< of common motion
};

struct LatencyLimits {
  double most_deviation_s = 0.0005;
  /// Below it neither position nor rotation moved enough to tell.
  double least_contrast = 3;  ///< worst_residual / residual
  /// worst_residual, too, lest rounding and small wobbles pass for motion where there is no noise.
  double least_move_m = 0.005;
  double least_turn_rad = 0.02;
  /// A rival that fits less than so many times worse may be the true one.
  double least_rival = 1.5;
  double least_seconds = 3;
};

/// Both on the same clock (CLOCK_MONOTONIC of one machine): two recordings made at the same time of
/// the same body, or of two bodies on one rigid thing. The frames of the worlds and of the bodies
/// need not agree: positions are compared up to a rigid motion, which needs the same point of the
/// thing (the lever arm between two is not solved for), and rotations, as quaternions, up to a turn
/// of four-dimensional space, which is just a change of frame on either side. The result is that of
/// the signal with the smaller deviation. A turntable's even turning tells nothing, being the same
/// but for a turn at any time: the motion must be uneven.
///
/// Sources: Arun, Huang, Blostein 1987, "Least-Squares Fitting of Two 3-D Point Sets"; Umeyama 1991
/// for the sign of the determinant.
/// Errors: kInvalidOption; kBadFormat where less than a second is common to both.
[[nodiscard]] Result<Latency> measure_latency(const PoseHistory& tracker,
                                              const PoseHistory& reference,
                                              const LatencyOptions& options);

/// Whether the measurement may be used. Errors: kUnavailable, which says what fell short of which
/// limit and what to do.
[[nodiscard]] Status check(const Latency& latency, const LatencyLimits& limits);

}  // namespace veneer::tracking
