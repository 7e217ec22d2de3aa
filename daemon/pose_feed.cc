// SPDX-License-Identifier: Apache-2.0
#include "daemon/pose_feed.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace veneer::daemon {

using namespace std::chrono_literals;

namespace {

constexpr Duration kStopCheck = 50ms;  // how long a stop may take

Duration::rep ticks(Time time) { return time.time_since_epoch().count(); }

}  // namespace

struct PoseFeed::BodyTrack {
  BodyTrack(tracking::BodyId id,
            const tracking::PredictionOptions& prediction,
            const tracking::ValidationOptions& validation)
      : body(id), validator(validation), track(prediction) {}

  void note(const SampleTimes& times) {
    const std::uint32_t before = turn.load(std::memory_order_relaxed);
    turn.store(before + 1, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    measured.store(ticks(times.measured), std::memory_order_relaxed);
    arrived.store(ticks(times.arrived), std::memory_order_relaxed);
    ready.store(ticks(times.ready), std::memory_order_relaxed);
    turn.store(before + 2, std::memory_order_release);
  }
  [[nodiscard]] std::optional<SampleTimes> times() const {
    const std::uint32_t before = turn.load(std::memory_order_acquire);
    const SampleTimes found{Time{Duration{measured.load(std::memory_order_relaxed)}},
                            Time{Duration{arrived.load(std::memory_order_relaxed)}},
                            Time{Duration{ready.load(std::memory_order_relaxed)}}};
    std::atomic_thread_fence(std::memory_order_acquire);
    if (before == 0 || before % 2 != 0 || turn.load(std::memory_order_relaxed) != before)
      return std::nullopt;
    return found;
  }

  tracking::BodyId body;
  tracking::Validator validator;
  tracking::PoseTrack track;
  // Odd while the times are being written; 0 before the first.
  std::atomic<std::uint32_t> turn{0};
  std::atomic<Duration::rep> measured{0};
  std::atomic<Duration::rep> arrived{0};
  std::atomic<Duration::rep> ready{0};
};

PoseFeed::PoseFeed(std::unique_ptr<tracking::Tracker> tracker,
                   OpenTracker open,
                   Clock& clock,
                   ClockKind kind,
                   const std::vector<tracking::BodyId>& bodies,
                   const tracking::PredictionOptions& prediction,
                   const tracking::ValidationOptions& validation)
    : tracker_(std::move(tracker)),
      description_(tracker_->description()),
      open_(std::move(open)),
      clock_(clock),
      prediction_(prediction),
      validation_(validation) {
  VENEER_CHECK(follow(bodies).has_value());
  if (kind == ClockKind::kMonotonic) {
    reader_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (read_one(kStopCheck)) continue;
        if (!open_ || (tracker_ && tracker_->ends())) return;
        // On the system's time whatever the clock: it is this thread's own.
        std::this_thread::sleep_for(kStopCheck);
      }
    });
  }
}

PoseFeed::~PoseFeed() = default;

Status PoseFeed::follow(const std::vector<tracking::BodyId>& bodies) {
  for (const tracking::BodyId body : bodies) {
    if (find(body) != nullptr) continue;
    const std::size_t count = track_count_.load(std::memory_order_relaxed);
    if (count == kMostBodies) {
      return fail(Errc::kInvalidOption,
                  "following body {}: {} bodies are followed already; start anew",
                  body,
                  count);
    }
    tracks_[count] = std::make_unique<BodyTrack>(body, prediction_, validation_);
    track_count_.store(count + 1, std::memory_order_release);
  }
  return {};
}

PoseFeed::BodyTrack* PoseFeed::find(tracking::BodyId body) const {
  const std::size_t count = track_count_.load(std::memory_order_acquire);
  for (std::size_t i = 0; i < count; ++i)
    if (tracks_[i]->body == body) return tracks_[i].get();
  return nullptr;
}

bool PoseFeed::read_one(Duration timeout) {
  if (lost_) {
    reopen();
    if (lost_) return false;
  }
  const Result<tracking::PoseSample> sample = tracker_->wait_pose(timeout);
  const Time arrived = clock_.now();
  watch_state();
  if (sample) {
    tracking::PoseSample taken = *sample;
    // Its clock and its numbers began anew with each opening.
    constexpr std::uint32_t kEpochsOfOne = 1U << 20U;
    taken.epoch += kEpochsOfOne * static_cast<std::uint32_t>(reopened_.load());
    take(taken, arrived);
    return true;
  }
  if (sample.error().code == Errc::kTimeout) return true;
  {
    const std::scoped_lock lock(health_mutex_);
    health_ = fail_while("reading the tracker", sample.error());
  }
  lost_ = true;
  backoff_.failed(clock_.now());
  return false;
}

void PoseFeed::reopen() {
  if (!open_ || (tracker_ && tracker_->ends()) || !backoff_.due(clock_.now())) return;
  // A device can be opened once at a time.
  std::unique_ptr<tracking::Tracker> old;
  {
    const std::scoped_lock lock(tracker_mutex_);
    old = std::move(tracker_);
  }
  old.reset();
  Result<std::unique_ptr<tracking::Tracker>> opened = open_();
  if (!opened) {
    backoff_.failed(clock_.now());
    const std::scoped_lock lock(health_mutex_);
    health_ = fail_while("opening the tracker again", opened.error());
    return;
  }
  {
    const std::scoped_lock lock(tracker_mutex_);
    tracker_ = *std::move(opened);
    description_ = tracker_->description();
  }
  ++reopened_;
  {
    const std::scoped_lock lock(health_mutex_);
    health_ = {};
  }
  lost_ = false;
}

void PoseFeed::take(tracking::PoseSample sample, Time arrived) {
  BodyTrack* body = find(sample.body);
  if (body == nullptr) return;
  // A stamp far ahead would make all that follow late: the eye would stand still until then.
  constexpr Duration kClockTolerance = 100ms;
  if (sample.time > arrived + kClockTolerance ||
      body->validator.check(sample) != tracking::Validator::Verdict::kValid ||
      body->track.add(sample) != tracking::PoseTrack::Verdict::kTaken) {
    ++rejected_;
    return;
  }
  body->note({sample.time, arrived, clock_.now()});
  backoff_.succeeded();
}

void PoseFeed::watch_state() {
  using tracking::TrackerState;
  const tracking::TrackerStatus status = tracker_->status();
  {
    const std::scoped_lock lock(health_mutex_);
    if (!events_.empty() && events_.back().state == status.state &&
        events_.back().detail == status.detail) {
      return;
    }
    if (events_.size() == kRememberedEvents) events_.pop_front();
    events_.push_back({clock_.now(), status.state, status.detail});
  }
  // Without the lock: the log may wait for its disk, and the frame loop asks for health().
  const bool bad = status.state == TrackerState::kAbsent || status.state == TrackerState::kFailed ||
                   status.state == TrackerState::kSilent;
  spdlog::log(bad ? spdlog::level::warn : spdlog::level::info,
              "tracker: {}{}{}",
              name_of(status.state),
              status.detail.empty() ? "" : ": ",
              status.detail);
}

std::vector<TrackerEvent> PoseFeed::events() const {
  const std::scoped_lock lock(health_mutex_);
  return {events_.begin(), events_.end()};
}

void PoseFeed::advance_to(Time when) {
  if (!reader_.joinable()) {
    while (clock_.now() < when && read_one(when - clock_.now())) {
    }
  }
  clock_.sleep_until(when);
}

void PoseFeed::slept(Duration time) {
  woke_ = clock_.now();
  slept_ = time;
}

tracking::PoseEstimate PoseFeed::at(tracking::BodyId body, Time when) const {
  const BodyTrack* track = find(body);
  VENEER_CHECK(track != nullptr);
  tracking::PoseEstimate estimate = track->track.at(when);
  if (woke_ == Time::min() || estimate.origin == tracking::PoseOrigin::kNone) return estimate;
  const Time measured = when - estimate.age;
  if (measured >= woke_) return estimate;
  // What moved then has long stopped.
  const Duration age = estimate.age + slept_;
  estimate = track->track.at(measured);
  estimate.origin = tracking::PoseOrigin::kHeld;
  estimate.velocity.setZero();
  estimate.angular_velocity.setZero();
  estimate.age = age;
  return estimate;
}

std::optional<SampleTimes> PoseFeed::newest(tracking::BodyId body) const {
  const BodyTrack* track = find(body);
  return track == nullptr ? std::nullopt : track->times();
}

std::optional<Time> PoseFeed::last_sample(tracking::BodyId body) const {
  const BodyTrack* track = find(body);
  constexpr std::uint32_t kFirstWritten = 2;
  if (track == nullptr || track->turn.load(std::memory_order_acquire) < kFirstWritten)
    return std::nullopt;
  return Time{Duration{track->ready.load(std::memory_order_relaxed)}};
}

Status PoseFeed::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

std::string PoseFeed::description() const {
  const std::scoped_lock lock(tracker_mutex_);
  return description_;
}

tracking::TrackerStatus PoseFeed::status() const {
  const std::scoped_lock lock(tracker_mutex_);
  if (tracker_) return tracker_->status();
  tracking::TrackerStatus status;
  status.state = tracking::TrackerState::kAbsent;
  return status;
}

}  // namespace veneer::daemon
