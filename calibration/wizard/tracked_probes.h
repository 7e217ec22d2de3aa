// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibration/wizard/devices.h"
#include "tracking/tracker.h"

namespace veneer::calibration {

struct StillOptions {
  double watch_s = 2;      ///< how long a body is watched. Above 0.5
  double patience_s = 20;  ///< how long it is waited for until it is still
  tracking::SynchronisedOptions still;
};

/// The pose of a body of a tracker while it stands still.
class TrackedPoseProbe final : public PoseProbe {
 public:
  /// Borrowed; must outlive this.
  TrackedPoseProbe(tracking::Tracker& tracker, tracking::BodyId body, const StillOptions& options)
      : tracker_(tracker), body_(body), options_(options) {}
  [[nodiscard]] Result<tracking::SynchronisedPose> measure() override;

 private:
  tracking::Tracker& tracker_;
  tracking::BodyId body_;
  StillOptions options_;
};

/// The tip of a tracked stylus while it is held still.
class TrackedPointProbe final : public PointProbe {
 public:
  /// @param tip_in_sensor  metres, as "veneer track eye" measures an offset.
  TrackedPointProbe(tracking::Tracker& tracker,
                    tracking::BodyId body,
                    const Eigen::Vector3d& tip_in_sensor,
                    const StillOptions& options)
      : sensor_(tracker, body, options), tip_in_sensor_(tip_in_sensor) {}
  [[nodiscard]] Result<Point> measure() override;

 private:
  TrackedPoseProbe sensor_;
  Eigen::Vector3d tip_in_sensor_;
};

}  // namespace veneer::calibration
