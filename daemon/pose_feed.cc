// SPDX-License-Identifier: Apache-2.0
#include "daemon/pose_feed.h"

#include <algorithm>

namespace veneer::daemon {

using namespace std::chrono_literals;

PoseFeed::PoseFeed(tracking::Tracker& tracker,
                   Clock& clock,
                   ClockKind kind,
                   const std::vector<tracking::BodyId>& bodies,
                   const tracking::PredictionOptions& prediction)
    : tracker_(tracker), clock_(clock) {
  for (const tracking::BodyId body : bodies) {
    tracks_.push_back(std::make_unique<BodyTrack>(body, prediction));
  }
  if (kind == ClockKind::kMonotonic) {
    reader_ = std::jthread([this](const std::stop_token& stop) {
      constexpr Duration kStopCheck = 50ms;  // how long a stop may take
      while (!stop.stop_requested() && read_one(kStopCheck)) {
      }
    });
  }
}

PoseFeed::~PoseFeed() = default;

bool PoseFeed::read_one(Duration timeout) {
  const Result<tracking::PoseSample> sample = tracker_.wait_pose(timeout);
  if (!sample) {
    if (sample.error().code == Errc::kTimeout) return true;
    const std::scoped_lock lock(health_mutex_);
    health_ = fail_while("reading the tracker", sample.error());
    lost_ = true;
    return false;
  }
  const auto found = std::ranges::find(
      tracks_, sample->body, [](const std::unique_ptr<BodyTrack>& track) { return track->body; });
  if (found == tracks_.end()) return true;
  // A stamp far ahead would make all that follow late: the eye would stand still until then.
  constexpr Duration kClockTolerance = 100ms;
  if (sample->time > clock_.now() + kClockTolerance ||
      (*found)->track.add(*sample) != tracking::PoseTrack::Verdict::kTaken) {
    ++rejected_;
  }
  return true;
}

void PoseFeed::advance_to(Time when) {
  if (!reader_.joinable()) {
    while (!lost_ && clock_.now() < when) read_one(when - clock_.now());
  }
  clock_.sleep_until(when);
}

tracking::PoseEstimate PoseFeed::at(tracking::BodyId body, Time when) const {
  const auto found = std::ranges::find(
      tracks_, body, [](const std::unique_ptr<BodyTrack>& track) { return track->body; });
  VENEER_CHECK(found != tracks_.end());
  return (*found)->track.at(when);
}

Status PoseFeed::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

}  // namespace veneer::daemon
