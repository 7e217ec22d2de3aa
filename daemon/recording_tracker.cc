// SPDX-License-Identifier: Apache-2.0
#include "daemon/recording_tracker.h"

#include <utility>

namespace veneer::daemon {

RecordingTracker::RecordingTracker(std::unique_ptr<tracking::Tracker> tracker,
                                   tracking::PoseRecorder& recorder,
                                   Heard heard)
    : tracker_(std::move(tracker)), recorder_(recorder), heard_(std::move(heard)) {}

std::string RecordingTracker::description() const { return tracker_->description() + ", recorded"; }

Result<tracking::PoseSample> RecordingTracker::wait_pose(Duration timeout) {
  Result<tracking::PoseSample> sample = tracker_->wait_pose(timeout);
  if (!sample) return sample;
  const Status written = recorder_.write(*sample);
  if (written.has_value() == failed_) {
    failed_ = !written;
    heard_(written);
  }
  return sample;
}

}  // namespace veneer::daemon
