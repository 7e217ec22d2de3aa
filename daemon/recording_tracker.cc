// SPDX-License-Identifier: Apache-2.0
#include "daemon/recording_tracker.h"

#include <spdlog/spdlog.h>

namespace veneer::daemon {

RecordingTracker::RecordingTracker(std::unique_ptr<tracking::Tracker> tracker,
                                   tracking::PoseRecorder recorder)
    : tracker_(std::move(tracker)), recorder_(std::move(recorder)) {}

std::string RecordingTracker::description() const { return tracker_->description() + ", recorded"; }

Result<tracking::PoseSample> RecordingTracker::wait_pose(Duration timeout) {
  Result<tracking::PoseSample> sample = tracker_->wait_pose(timeout);
  if (sample && !given_up_) {
    if (const Status status = recorder_.write(*sample); !status) {
      spdlog::warn("recording poses is given up: {}", status.error().what);
      given_up_ = true;
    }
  }
  return sample;
}

}  // namespace veneer::daemon
