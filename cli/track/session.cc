// SPDX-License-Identifier: Apache-2.0
#include "cli/track/session.h"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <utility>

#include "base/toml_reader.h"
#include "tracking/drivers.h"

namespace veneer::cli {
namespace {

using namespace std::chrono_literals;

std::atomic<bool> stop_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

void request_stop(int) { stop_requested = true; }

/// How long a stop may take.
constexpr Duration kStopCheck = 50ms;

}  // namespace

Result<TrackSession> TrackSession::open(const std::filesystem::path& config,
                                        const std::vector<std::string>& settings) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(config, settings));
  TomlReader table = toml.table("tracker");
  toml.ignore_the_rest();
  TrackSession session;
  session.opened_ = session.clock_->now();
  VENEER_ASSIGN(session.tracker_, tracking::open_tracker(table, *session.clock_));
  VENEER_TRY(toml.finish());
  return session;
}

Status TrackSession::run(double seconds,
                         const std::function<Status(const tracking::PoseSample&)>& take,
                         Duration tick_period,
                         const std::function<void()>& tick) {
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);

  const Time start = clock_->now();
  const Time end = seconds > 0 ? start + from_seconds(seconds) : Time::max();
  Time next_tick = start + tick_period;
  for (Time now = start; now < end && !stop_requested; now = clock_->now()) {
    if (now >= next_tick) {
      tick();
      next_tick = std::max(next_tick, now - tick_period) + tick_period;
    }
    const Time wake = std::min({end, next_tick, now + kStopCheck});
    const Result<tracking::PoseSample> sample = tracker_->wait_pose(wake - now);
    if (sample) {
      const Time arrival = clock_->now();
      bodies_[sample->body].add(*sample, arrival);
      recent_[sample->body].add(*sample, arrival);
      VENEER_TRY(take(*sample));
    } else if (sample.error().code == Errc::kDisconnected) {
      return {};
    } else if (sample.error().code != Errc::kTimeout) {
      return fail_while("reading the tracker", sample.error());
    }
  }
  return {};
}

BodyStatistics TrackSession::take_recent() { return std::exchange(recent_, {}); }

double TrackSession::seconds() const { return to_seconds(clock_->now() - opened_); }

tl::unexpected<Error> TrackSession::nothing_came() const {
  const tracking::TrackerStatus status = tracker_->status();
  return fail(Errc::kTimeout,
              "{}: no sample came in {:.1f} s; it is {}{}{}",
              tracker_->description(),
              seconds(),
              name_of(status.state),
              status.detail.empty() ? "" : ": ",
              status.detail);
}

}  // namespace veneer::cli
