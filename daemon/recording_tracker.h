// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "tracking/recording.h"
#include "tracking/tracker.h"

namespace veneer::daemon {

/// Passes a tracker's samples on and writes each to a file, so that a day's trouble can be
/// replayed.
class RecordingTracker final : public tracking::Tracker {
 public:
  /// Told of what could not be written, when that begins and when it is over.
  using Heard = std::function<void(const Status&)>;
  /// @param recorder  borrowed: the recording goes on when the tracker is opened again.
  RecordingTracker(std::unique_ptr<tracking::Tracker> tracker,
                   tracking::PoseRecorder& recorder,
                   Heard heard);
  [[nodiscard]] std::string description() const override;
  /// A sample that cannot be written (a full disk) is missing in the recording; poses go on, and
  /// recording does when it can.
  [[nodiscard]] Result<tracking::PoseSample> wait_pose(Duration timeout) override;
  [[nodiscard]] bool ends() const override { return tracker_->ends(); }
  [[nodiscard]] tracking::TrackerStatus status() const override { return tracker_->status(); }

 private:
  std::unique_ptr<tracking::Tracker> tracker_;
  tracking::PoseRecorder& recorder_;
  Heard heard_;
  bool failed_ = false;
};

}  // namespace veneer::daemon
