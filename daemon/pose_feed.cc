// SPDX-License-Identifier: Apache-2.0
#include "daemon/pose_feed.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace veneer::daemon {

using namespace std::chrono_literals;

PoseFeed::PoseFeed(tracking::Tracker& tracker,
                   Clock& clock,
                   ClockKind kind,
                   const std::vector<tracking::BodyId>& bodies,
                   const tracking::PredictionOptions& prediction,
                   const tracking::ValidationOptions& validation)
    : tracker_(tracker), clock_(clock) {
  for (const tracking::BodyId body : bodies) {
    tracks_.push_back(std::make_unique<BodyTrack>(body, prediction, validation));
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
  watch_state();
  if (sample) {
    take(*sample);
    return true;
  }
  if (sample.error().code == Errc::kTimeout) return true;
  const std::scoped_lock lock(health_mutex_);
  health_ = fail_while("reading the tracker", sample.error());
  lost_ = true;
  return false;
}

void PoseFeed::take(tracking::PoseSample sample) {
  const auto found = std::ranges::find(
      tracks_, sample.body, [](const std::unique_ptr<BodyTrack>& track) { return track->body; });
  if (found == tracks_.end()) return;
  BodyTrack& body = **found;
  // A stamp far ahead would make all that follow late: the eye would stand still until then.
  constexpr Duration kClockTolerance = 100ms;
  if (sample.time > clock_.now() + kClockTolerance ||
      body.validator.check(sample) != tracking::Validator::Verdict::kValid ||
      body.track.add(sample) != tracking::PoseTrack::Verdict::kTaken) {
    ++rejected_;
  }
}

void PoseFeed::watch_state() {
  using tracking::TrackerState;
  tracking::TrackerStatus status = tracker_.status();
  const std::scoped_lock lock(health_mutex_);
  if (!events_.empty() && events_.back().state == status.state &&
      events_.back().detail == status.detail) {
    return;
  }
  const bool bad = status.state == TrackerState::kAbsent || status.state == TrackerState::kFailed ||
                   status.state == TrackerState::kSilent;
  spdlog::log(bad ? spdlog::level::warn : spdlog::level::info,
              "tracker: {}{}{}",
              name_of(status.state),
              status.detail.empty() ? "" : ": ",
              status.detail);
  if (events_.size() == kRememberedEvents) events_.pop_front();
  events_.push_back({clock_.now(), status.state, std::move(status.detail)});
}

std::vector<TrackerEvent> PoseFeed::events() const {
  const std::scoped_lock lock(health_mutex_);
  return {events_.begin(), events_.end()};
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
