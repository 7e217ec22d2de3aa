// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/tracked_probes.h"

#include <algorithm>
#include <array>
#include <optional>

#include "calibration/geometry/registration.h"
#include "tracking/pose_history.h"

namespace veneer::calibration {

Result<tracking::SynchronisedPose> TrackedPoseProbe::measure() {
  using namespace std::chrono_literals;
  constexpr Duration kSlice = 100ms;
  std::array<tracking::PoseHistory, 1> history;
  bool seen = false;
  // Time is told by the samples, which are on the tracker's clock, and by the slices in which
  // nothing came. What was measured before the first sample after the call is not asked for.
  std::optional<Time> begin;
  Time watch_from;
  Duration waited{};
  Duration passed{};
  while (waited + passed < from_seconds(options_.patience_s)) {
    auto sample = tracker_.wait_pose(kSlice);
    if (!sample) {
      if (sample.error().code != Errc::kTimeout) return tl::unexpected(sample.error());
      waited += kSlice;
      continue;
    }
    if (!begin) begin = watch_from = sample->time;
    passed = std::max(passed, sample->time - *begin);
    if (sample->body != body_) continue;
    seen = true;
    history[0].add(*sample);
    if (sample->time - watch_from < from_seconds(options_.watch_s)) continue;
    const auto still = tracking::still_samples(history, options_.still);
    if (!still.empty()) return still.back().poses.front();
    watch_from = sample->time;
    history[0] = {};
  }
  return seen ? fail(Errc::kTimeout,
                     "body {} did not stand still for {} s; put it down or hold it firmly",
                     body_,
                     options_.still.least_still_s)
              : fail(Errc::kTimeout,
                     "body {} was not seen for {} s; is it in the tracker's range?",
                     body_,
                     options_.patience_s);
}

Result<PointProbe::Point> TrackedPointProbe::measure() {
  VENEER_ASSIGN(const tracking::SynchronisedPose sensor, sensor_.measure());
  const geometry::TouchedPoint point = geometry::touched_point(sensor, tip_in_sensor_);
  return Point{point.x_in_world, point.deviation_m};
}

}  // namespace veneer::calibration
