// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "tracking/recording.h"
#include "tracking/tracker.h"

namespace veneer::daemon {

/// Passes a tracker's samples on and writes each to a file, so that a day's trouble can be
/// replayed.
class RecordingTracker final : public tracking::Tracker {
 public:
  RecordingTracker(std::unique_ptr<tracking::Tracker> tracker, tracking::PoseRecorder recorder);
  [[nodiscard]] std::string description() const override;
  /// A recording that cannot be written (a full disk) is given up with one warning; poses go on.
  [[nodiscard]] Result<tracking::PoseSample> wait_pose(Duration timeout) override;
  [[nodiscard]] tracking::TrackerStatus status() const override { return tracker_->status(); }

 private:
  std::unique_ptr<tracking::Tracker> tracker_;
  tracking::PoseRecorder recorder_;
  bool given_up_ = false;
};

}  // namespace veneer::daemon
