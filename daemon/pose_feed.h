// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "daemon/config.h"
#include "tracking/pose_track.h"
#include "tracking/tracker.h"

namespace veneer::daemon {

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
           const tracking::PredictionOptions& prediction);
  ~PoseFeed();

  /// Lets time pass until `when`, while samples come in.
  void advance_to(Time when);
  /// Where the body will be at `when`; kNone before its first sample. Never waits.
  [[nodiscard]] tracking::PoseEstimate at(tracking::BodyId body, Time when) const;
  /// Whether the tracker has gone for good. Never waits.
  [[nodiscard]] bool lost() const { return lost_; }
  /// The same, and why.
  [[nodiscard]] Status health() const;
  /// Samples that were not taken: duplicate, late, invalid or of a time yet to come.
  [[nodiscard]] std::uint64_t rejected() const { return rejected_; }

 private:
  struct BodyTrack {
    BodyTrack(tracking::BodyId id, const tracking::PredictionOptions& prediction)
        : body(id), track(prediction) {}
    tracking::BodyId body;
    tracking::PoseTrack track;
  };
  /// Takes one sample, or returns after `timeout`; false when the tracker is gone.
  bool read_one(Duration timeout);

  tracking::Tracker& tracker_;
  Clock& clock_;
  std::vector<std::unique_ptr<BodyTrack>> tracks_;  // pointers, since a PoseTrack cannot move
  std::atomic<std::uint64_t> rejected_{0};
  mutable std::mutex health_mutex_;
  Status health_;
  std::atomic<bool> lost_{false};
  std::jthread reader_;  // last: it stops before what it uses goes
};

}  // namespace veneer::daemon
