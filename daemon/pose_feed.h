// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "daemon/config.h"
#include "tracking/pose_track.h"
#include "tracking/tracker.h"
#include "tracking/validator.h"

namespace veneer::daemon {

/// What a tracker said of itself, when that changed.
struct TrackerEvent {
  Time time;
  tracking::TrackerState state = tracking::TrackerState::kTracking;
  std::string detail;
};

/// Carries samples from a tracker into one pose track per body. In real time a thread of its own
/// reads the tracker; on a virtual clock, whose time only one thread may move, the frame loop does.
class PoseFeed {
 public:
  /// @param tracker, clock  borrowed; must outlive the feed.
  /// @param bodies  those that somebody will ask for; samples of others are dropped.
  PoseFeed(tracking::Tracker& tracker,
           Clock& clock,
           ClockKind kind,
           const std::vector<tracking::BodyId>& bodies,
           const tracking::PredictionOptions& prediction,
           const tracking::ValidationOptions& validation);
  ~PoseFeed();

  /// Lets time pass until `when`, while samples come in.
  void advance_to(Time when);
  /// Where the body will be at `when`; kNone before its first sample. Never waits.
  [[nodiscard]] tracking::PoseEstimate at(tracking::BodyId body, Time when) const;
  /// Whether the tracker has gone for good. Never waits.
  [[nodiscard]] bool lost() const { return lost_; }
  /// The same, and why.
  [[nodiscard]] Status health() const;
  /// The last kRememberedEvents changes of the tracker's state; each was logged too.
  [[nodiscard]] std::vector<TrackerEvent> events() const;
  static constexpr std::size_t kRememberedEvents = 1000;
  /// Samples that were not taken: duplicate, late, invalid, wild or of a time yet to come.
  [[nodiscard]] std::uint64_t rejected() const { return rejected_; }

 private:
  struct BodyTrack {
    BodyTrack(tracking::BodyId id,
              const tracking::PredictionOptions& prediction,
              const tracking::ValidationOptions& validation)
        : body(id), validator(validation), track(prediction) {}
    tracking::BodyId body;
    tracking::Validator validator;
    tracking::PoseTrack track;
  };
  /// Takes one sample, or returns after `timeout`; false when the tracker is gone.
  bool read_one(Duration timeout);
  void take(tracking::PoseSample sample);
  void watch_state();

  tracking::Tracker& tracker_;
  Clock& clock_;
  std::vector<std::unique_ptr<BodyTrack>> tracks_;  // pointers, since a PoseTrack cannot move
  std::atomic<std::uint64_t> rejected_{0};
  mutable std::mutex health_mutex_;
  Status health_;
  std::deque<TrackerEvent> events_;
  std::atomic<bool> lost_{false};
  std::jthread reader_;  // last: it stops before what it uses goes
};

}  // namespace veneer::daemon
