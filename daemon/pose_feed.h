// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "daemon/backoff.h"
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

/// The way of a sample to whoever draws with it.
struct SampleTimes {
  Time measured;
  Time arrived;  ///< when the tracker's driver handed it out
  Time ready;    ///< when a frame could read it
};

/// Carries samples from a tracker into one pose track per body, and opens the tracker again when it
/// has gone for good. In real time a thread of its own does both; on a virtual clock, whose time
/// only one thread may move, the frame loop does.
class PoseFeed {
 public:
  using OpenTracker = std::function<Result<std::unique_ptr<tracking::Tracker>>()>;
  /// @param open    empty where a tracker that has gone stays away.
  /// @param clock   borrowed; must outlive the feed.
  /// @param bodies  those that somebody will ask for; samples of others are dropped.
  PoseFeed(std::unique_ptr<tracking::Tracker> tracker,
           OpenTracker open,
           Clock& clock,
           ClockKind kind,
           const std::vector<tracking::BodyId>& bodies,
           const tracking::PredictionOptions& prediction,
           const tracking::ValidationOptions& validation);
  ~PoseFeed();

  /// Further bodies; those that are known already stay as they are. One thread at a time.
  /// Errors: kInvalidOption (more than kMostBodies in all).
  [[nodiscard]] Status follow(const std::vector<tracking::BodyId>& bodies);
  static constexpr std::size_t kMostBodies = 64;

  /// Lets time pass until `when`, while samples come in.
  void advance_to(Time when);
  /// Where the body will be at `when`; kNone before its first sample. Never waits. A pose from
  /// before a sleep of the machine is only held, and as old as it is with the sleep.
  [[nodiscard]] tracking::PoseEstimate at(tracking::BodyId body, Time when) const;
  /// Of the newest sample of a body; nothing while it is being replaced. Never waits.
  [[nodiscard]] std::optional<SampleTimes> newest(tracking::BodyId body) const;
  /// The machine slept, and CLOCK_MONOTONIC stood still meanwhile. For the thread that asks at().
  void slept(Duration time);

  /// Whether the tracker has gone and was not opened again yet. Never waits.
  [[nodiscard]] bool lost() const { return lost_; }
  /// The same, and why.
  [[nodiscard]] Status health() const;
  /// When the last sample of a body was taken; nothing before the first. Never waits.
  [[nodiscard]] std::optional<Time> last_sample(tracking::BodyId body) const;
  /// The last kRememberedEvents changes of the tracker's state; each was logged too.
  [[nodiscard]] std::vector<TrackerEvent> events() const;
  static constexpr std::size_t kRememberedEvents = 1000;
  /// Samples that were not taken: duplicate, late, invalid, wild or of a time yet to come.
  [[nodiscard]] std::uint64_t rejected() const { return rejected_; }
  /// How often it was opened again.
  [[nodiscard]] std::uint64_t reopened() const { return reopened_; }
  /// Of the tracker that is open, or was last.
  [[nodiscard]] std::string description() const;
  [[nodiscard]] tracking::TrackerStatus status() const;

 private:
  struct BodyTrack;
  /// Takes one sample, or returns after `timeout`; false when the tracker is gone.
  bool read_one(Duration timeout);
  void reopen();
  void take(tracking::PoseSample sample, Time arrived);
  void watch_state();
  [[nodiscard]] BodyTrack* find(tracking::BodyId body) const;

  // Only the thread that reads it exchanges it, under the lock; others ask it under the lock.
  mutable std::mutex tracker_mutex_;
  std::unique_ptr<tracking::Tracker> tracker_;
  std::string description_;
  const OpenTracker open_;
  Clock& clock_;
  const tracking::PredictionOptions prediction_;
  const tracking::ValidationOptions validation_;
  // Only grows; what is below the count never changes.
  std::array<std::unique_ptr<BodyTrack>, kMostBodies> tracks_;
  std::atomic<std::size_t> track_count_{0};
  std::atomic<std::uint64_t> rejected_{0};
  std::atomic<std::uint64_t> reopened_{0};
  mutable std::mutex health_mutex_;
  Status health_;
  std::deque<TrackerEvent> events_;
  std::atomic<bool> lost_{false};
  Backoff backoff_;
  // The frame loop's own.
  Time woke_ = Time::min();
  Duration slept_{};
  std::jthread reader_;  // last: it stops before what it uses goes
};

}  // namespace veneer::daemon
