// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "tracking/pose_history.h"

namespace veneer::tracking {

/// One body's pose at an instant at which others are known too, and how well.
struct SynchronisedPose {
  RigidTransform world_from_body;
  /// Standard deviations of the pose itself: of a coordinate, of a component of the turning.
  double position_deviation_m = 0;
  double rotation_deviation_rad = 0;
  int samples = 0;  ///< it was made from
};

/// Several bodies at once: what registration (`calibration/`) starts from.
struct SynchronisedSample {
  Time time;                            ///< the middle of what was averaged
  Duration span{};                      ///< from its first moment to its last
  std::vector<SynchronisedPose> poses;  ///< in the order of the histories
};

struct SynchronisedOptions {
  /// Poses at a moment come from the samples of so long to either side. Over 0, at most 0.5.
  double half_width_s = 0.025;
  /// Speeds are those of the samples of so long to either side. Over 0, at most 0.5.
  double speed_half_width_s = 0.1;
  /// Slower than this a body counts as still. A tracker's noise of 0.2 mm and 0.02 degrees at
  /// 240 Hz passes for some 1.6 mm/s and 0.2 degrees/s.
  double still_m_s = 0.01;
  double still_deg_s = 1;
  double least_still_s = 0.5;  ///< that all bodies have to be still together

  [[nodiscard]] Status check() const;  ///< Errors: kInvalidOption
};

/// The bodies at each of `moments` at which all of them are known. All histories are on one clock.
/// @param options  checked by the caller.
[[nodiscard]] std::vector<SynchronisedSample> samples_at(std::span<const PoseHistory> histories,
                                                         std::span<const Time> moments,
                                                         const SynchronisedOptions& options);

/// The mean poses of every span in which no body moved. Their deviations are those of the means of
/// five parts of the span, so that slow drift counts, over the root of five.
/// @param options  checked by the caller.
[[nodiscard]] std::vector<SynchronisedSample> still_samples(std::span<const PoseHistory> histories,
                                                            const SynchronisedOptions& options);

}  // namespace veneer::tracking
