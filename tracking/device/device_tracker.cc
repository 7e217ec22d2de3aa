// SPDX-License-Identifier: Apache-2.0
#include "tracking/device/device_tracker.h"

#include <algorithm>
#include <utility>

namespace veneer::tracking {
namespace {

using namespace std::chrono_literals;

constexpr Duration kFirstBackoff = 100ms;
constexpr Duration kLongestBackoff = 5s;
constexpr double kBackoffSpread = 0.2;
constexpr Duration kWriteTime = 100ms;
/// Without a sample for so long it is told again what to send. Longer than any hiccup of a host or
/// a bus: telling it costs samples.
constexpr Duration kSilence = 250ms;
/// Without a byte for so long it is opened again.
constexpr Duration kDeadSilence = 1s;
/// So many errors within this time, and it is opened again.
constexpr int kErrors = 3;
constexpr Duration kErrorTime = 1s;
/// Samples in a row with the same ticks, and the clock counts as standing still.
constexpr int kFrozen = 8;
/// Longer waits are cut; the caller asks again.
constexpr Duration kLongestWait = 1h;

std::string_view text_of(IoStatus status) {
  switch (status) {
    case IoStatus::kStall:
      return "its endpoint is halted";
    case IoStatus::kOverflow:
      return "it sends more than was asked for";
    case IoStatus::kGone:
      return "it was unplugged, or has closed the connection";
    case IoStatus::kTimeout:
      return "it does not take commands";
    default:
      return "transfers fail; look at its cable";
  }
}

}  // namespace

DeviceTrackerOptions DeviceTrackerOptions::read(TomlReader& toml) {
  DeviceTrackerOptions options;
  toml.read("latency_ms", options.latency_ms);
  if (!(options.latency_ms >= 0 && options.latency_ms <= 1000)) {
    toml.add_error("latency_ms", fmt::format("{} is outside 0 to 1000", options.latency_ms));
  }
  return options;
}

DeviceTracker::DeviceTracker(std::unique_ptr<Port> port,
                             std::unique_ptr<Protocol> protocol,
                             const DeviceTrackerOptions& options,
                             Clock& clock)
    : port_(std::move(port)),
      protocol_(std::move(protocol)),
      options_(options),
      clock_(clock),
      buffer_(Transport::kLargestMessage),
      retry_at_(clock.now()),
      backoff_(kFirstBackoff) {
  if (const auto device_clock = protocol_->clock()) mapper_.emplace(*device_clock);
  status_ = {TrackerState::kAbsent, "not opened yet", {}};
}

std::string DeviceTracker::description() const { return port_->description(); }

TrackerStatus DeviceTracker::status() const {
  const std::scoped_lock lock(status_mutex_);
  return status_;
}

void DeviceTracker::set_state(TrackerState state, std::string detail) {
  const std::scoped_lock lock(status_mutex_);
  status_.state = state;
  status_.detail = std::move(detail);
}

template <class Change>
void DeviceTracker::count(Change change) {
  const std::scoped_lock lock(status_mutex_);
  change(status_.counters);
}

Result<PoseSample> DeviceTracker::wait_pose(Duration timeout) {
  const Time deadline = clock_.now() + std::clamp(timeout, Duration{0}, kLongestWait);
  do {
    if (samples_.empty()) step(deadline);
    if (!samples_.empty()) {
      const PoseSample sample = samples_.front();
      samples_.pop_front();
      count([](TrackerCounters& counters) { ++counters.samples; });
      return sample;
    }
  } while (clock_.now() < deadline);
  // Short enough to need no allocation: a frame loop meets it often.
  return tl::unexpected<Error>(Error{Errc::kTimeout, "no pose in time"});
}

void DeviceTracker::step(Time deadline) {
  if (!transport_) {
    try_to_open(deadline);
  } else if (next_command_ < commands_.size() || clock_.now() < pause_until_) {
    initialise(deadline);
  } else {
    receive(deadline);
  }
}

void DeviceTracker::try_to_open(Time deadline) {
  if (clock_.now() < retry_at_) {
    if (!port_->wait_for_arrival(std::min(deadline, retry_at_))) return;
    backoff_ = kFirstBackoff;
  }
  Result<std::unique_ptr<Transport>> opened = port_->open();
  if (!opened) {
    const bool absent = opened.error().code == Errc::kNotFound;
    if (!absent) count([](TrackerCounters& counters) { ++counters.open_errors; });
    close(absent ? TrackerState::kAbsent : TrackerState::kFailed, opened.error().what);
    return;
  }
  transport_ = *std::move(opened);
  count([](TrackerCounters& counters) { ++counters.opened; });
  errors_in_a_row_ = 0;
  stall_cleared_ = false;
  newest_bytes_ = clock_.now();
  start(protocol_->start(), TrackerState::kInitialising, {});
}

void DeviceTracker::begin_epoch() {
  ++epoch_;
  if (mapper_) mapper_->reset();
  for (auto& [number, sensor] : sensors_) {
    sensor.sequence.reset();
    sensor.ticks.reset();
    sensor.equal_ticks = 0;
  }
}

void DeviceTracker::start(std::vector<Command> commands, TrackerState state, std::string detail) {
  const Time now = clock_.now();
  begin_epoch();  // whatever happened to it may have happened to its clock
  protocol_->reset();
  commands_ = std::move(commands);
  next_command_ = 0;
  pause_until_ = now;
  newest_sample_ = now;
  newest_restart_ = now;
  set_state(state, std::move(detail));
  if (commands_.empty()) on_started();
}

void DeviceTracker::initialise(Time deadline) {
  const Time now = clock_.now();
  if (now < pause_until_) {
    // What it says before it is told all is of no use, but has to be taken away.
    const Received received = transport_->read(buffer_, std::min(deadline, pause_until_));
    if (received.status != IoStatus::kOk && received.status != IoStatus::kTimeout) {
      on_error_while_starting(received.status, deadline);
    }
    return;
  }
  const Command& command = commands_[next_command_];
  const IoStatus status = command.kind == Command::Kind::kFeature
                              ? transport_->send_feature(command.bytes)
                              : transport_->write(command.bytes, now + kWriteTime);
  if (status == IoStatus::kGone) {
    on_error(status);
    return;
  }
  if (status != IoStatus::kOk) {
    count([](TrackerCounters& counters) { ++counters.io_errors; });
    close(TrackerState::kFailed,
          fmt::format("starting {}: {}", port_->description(), text_of(status)));
    return;
  }
  ++next_command_;
  pause_until_ = clock_.now() + command.pause;
  if (next_command_ == commands_.size()) on_started();
}

void DeviceTracker::on_started() {
  newest_sample_ = pause_until_;
  if (status_.state == TrackerState::kInitialising) {
    set_state(TrackerState::kSyncing, "waits for the first sample");
  }
}

void DeviceTracker::receive(Time deadline) {
  const Time restart_at =
      std::max(newest_sample_, newest_restart_) + kSilence + 4 * protocol_->period();
  const Time reopen_at = protocol_->recovery() == Recovery::kListen
                             ? Time::max()
                             : newest_bytes_ + kDeadSilence + 4 * protocol_->period();
  const Received received = transport_->read(buffer_, std::min({deadline, restart_at, reopen_at}));
  if (received.status == IoStatus::kOk) {
    newest_bytes_ = std::max(newest_bytes_, received.arrival);
    take_bytes(std::span(buffer_).first(received.bytes), received.arrival);
    return;
  }
  if (received.status != IoStatus::kTimeout) {
    on_error(received.status);
    return;
  }
  const Time now = clock_.now();
  if (now >= reopen_at) {
    close(TrackerState::kSilent,
          fmt::format("{} has sent nothing for {:.1f} s; it is opened again",
                      port_->description(),
                      to_seconds(now - newest_bytes_)));
  } else if (now >= restart_at) {
    on_silence(now);
  }
}

void DeviceTracker::on_silence(Time now) {
  const Recovery recovery = protocol_->recovery();
  const std::string text = fmt::format(
      "{} has sent no pose for {:.2f} s", port_->description(), to_seconds(now - newest_sample_));
  if (recovery == Recovery::kTellAgain) {
    std::vector<Command> commands = protocol_->restart();
    const bool told = !commands.empty();
    if (told) count([](TrackerCounters& counters) { ++counters.restarts; });
    start(std::move(commands),
          TrackerState::kSilent,
          text + (told ? "; it was told again to send" : ""));
    return;
  }
  newest_restart_ = now;
  // Said once: a sender that is off may be off for days.
  const bool known = status_.state == TrackerState::kSilent;
  if (recovery == Recovery::kListen) {
    if (!known) set_state(TrackerState::kSilent, text + "; does it send, and to here?");
    return;
  }
  if (!known) {
    set_state(TrackerState::kSilent,
              text +
                  "; it was asked whether it is there. Does it know the body, or tracker, by "
                  "this name?");
  }
  for (const Command& command : protocol_->restart()) {
    const IoStatus status = transport_->write(command.bytes, now + kWriteTime);
    if (status == IoStatus::kOk) continue;
    on_error(status);
    return;
  }
}

void DeviceTracker::take_bytes(std::span<const std::byte> bytes, Time arrival) {
  raw_.clear();
  reply_.clear();
  protocol_->feed(bytes, raw_, reply_);
  for (std::size_t i = 0; i < raw_.size(); ++i) {
    // Where nothing but the arrival tells them apart, the last of a message is the newest.
    const bool stale =
        !raw_[i].ticks && !raw_[i].sequence &&
        std::any_of(raw_.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                    raw_.end(),
                    [&](const RawSample& other) { return other.sensor == raw_[i].sensor; });
    if (stale) {
      count([](TrackerCounters& counters) { ++counters.late; });
    } else {
      take_sample(raw_[i], arrival);
    }
  }

  const ProtocolCounters now_seen = protocol_->counters();
  if (now_seen.skipped_bytes != seen_.skipped_bytes || now_seen.bad_frames != seen_.bad_frames) {
    count([&](TrackerCounters& counters) {
      counters.skipped_bytes += now_seen.skipped_bytes - seen_.skipped_bytes;
      counters.bad_frames += now_seen.bad_frames - seen_.bad_frames;
    });
    seen_ = now_seen;
  }
  if (!reply_.empty()) {
    const IoStatus status = transport_->write(reply_, clock_.now() + kWriteTime);
    if (status != IoStatus::kOk) {
      on_error(status);
      return;
    }
  }
  if (protocol_->wants_restart() && protocol_->recovery() != Recovery::kTellAgain) {
    close(TrackerState::kFailed,
          fmt::format("{} says what is not understood; is it what it should be, in a version that "
                      "is known here? It is opened again",
                      port_->description()));
  } else if (protocol_->wants_restart() && clock_.now() - newest_restart_ >= kSilence) {
    count([](TrackerCounters& counters) { ++counters.restarts; });
    start(protocol_->restart(),
          TrackerState::kInitialising,
          fmt::format("{} has forgotten what it was told; it is told again", port_->description()));
  }
}

void DeviceTracker::take_sample(const RawSample& raw, Time arrival) {
  Sensor& sensor = sensors_[raw.sensor];
  const std::optional<Time> time = time_of(raw, sensor, arrival);
  if (!time) return;
  newest_sample_ = std::max(newest_sample_, arrival);
  const std::uint64_t passed = step_of(raw, sensor);
  if (passed > 1) count([passed](TrackerCounters& counters) { counters.lost += passed - 1; });
  if (raw.sequence) {
    sensor.sequence = widen(*protocol_->sequence(), *raw.sequence, sensor.sequence);
  }
  sensor.sent += passed;
  sensor.newest = time;
  backoff_ = kFirstBackoff;
  errors_in_a_row_ = 0;
  stall_cleared_ = false;
  const bool locked = !mapper_ || mapper_->locked();
  if (const TrackerState state = locked ? TrackerState::kTracking : TrackerState::kClockLocking;
      status_.state != state) {
    set_state(state, {});
  }
  if (raw.suspect) {
    count([](TrackerCounters& counters) { ++counters.suspect; });
    return;
  }
  if (!locked) ++epoch_;
  samples_.push_back({raw.sensor, *time, {raw.rotation, raw.position_m}, sensor.sent, epoch_});
}

std::optional<Time> DeviceTracker::time_of(const RawSample& raw, Sensor& sensor, Time arrival) {
  Time time = arrival;
  const std::optional<WrappingCounter> sequence = protocol_->sequence();
  const bool same_sequence = raw.sequence && sequence && sensor.sequence &&
                             widen(*sequence, *raw.sequence, sensor.sequence) == *sensor.sequence;
  if (raw.ticks && mapper_) {
    const bool same_ticks = sensor.ticks == raw.ticks;
    // A clock that stood still, or goes again, has no more to do with what was learnt of it.
    if (!same_ticks && sensor.equal_ticks >= kFrozen) begin_epoch();
    sensor.equal_ticks = same_ticks ? sensor.equal_ticks + 1 : 0;
    sensor.ticks = raw.ticks;
    if (sensor.equal_ticks == kFrozen) ++epoch_;
    const bool frozen = sensor.equal_ticks >= kFrozen;
    if (same_ticks && !frozen) {
      count([](TrackerCounters& counters) { ++counters.duplicates; });
      return std::nullopt;
    }
    if (!frozen) {
      const ClockMapper::Mapped mapped = mapper_->map(*raw.ticks, arrival);
      if (mapped.verdict == ClockMapper::Verdict::kOutlier) {
        count([](TrackerCounters& counters) { ++counters.clock_outliers; });
        return std::nullopt;
      }
      if (mapped.verdict == ClockMapper::Verdict::kRestarted) {
        count([](TrackerCounters& counters) { ++counters.clock_restarts; });
        ++epoch_;
        for (auto& [number, other] : sensors_) other.sequence.reset();
      }
      time = mapped.time;
    }
  } else if (same_sequence) {
    count([](TrackerCounters& counters) { ++counters.duplicates; });
    return std::nullopt;
  }
  time -= from_seconds(options_.latency_ms * 1e-3);
  if (sensor.newest && time <= *sensor.newest) {
    count([](TrackerCounters& counters) { ++counters.late; });
    return std::nullopt;
  }
  return time;
}

std::uint64_t DeviceTracker::step_of(const RawSample& raw, Sensor& sensor) const {
  const std::optional<WrappingCounter> counter = protocol_->sequence();
  if (!raw.sequence || !counter || !sensor.sequence) return 1;
  // Forwards only: what lies behind in time was dropped already.
  const std::uint64_t difference = *raw.sequence - static_cast<std::uint64_t>(*sensor.sequence);
  const int spare = 64 - counter->bits;
  return std::max<std::uint64_t>(1, difference << spare >> spare);
}

void DeviceTracker::on_error(IoStatus status) {
  count([](TrackerCounters& counters) { ++counters.io_errors; });
  if (status == IoStatus::kGone) {
    close(TrackerState::kAbsent,
          fmt::format("{}: {}; it is waited for", port_->description(), text_of(status)));
    return;
  }
  if (status == IoStatus::kStall && !stall_cleared_) {
    stall_cleared_ = true;
    if (transport_->clear_stall() == IoStatus::kOk) return;
  }
  const Time now = clock_.now();
  if (errors_in_a_row_ == 0 || now - first_error_ > kErrorTime) {
    errors_in_a_row_ = 0;
    first_error_ = now;
  }
  if (++errors_in_a_row_ >= kErrors || status == IoStatus::kStall) {
    close(TrackerState::kFailed,
          fmt::format("{}: {}; it is opened again", port_->description(), text_of(status)));
  }
}

void DeviceTracker::on_error_while_starting(IoStatus status, Time deadline) {
  if (status == IoStatus::kGone) {
    on_error(status);
    return;
  }
  // It costs nothing that was wanted; if it lasts, receive() will meet it. Opening again instead
  // would meet it again, later and later. Nothing more is read in this pause, since a transfer may
  // fail at once, for ever.
  count([](TrackerCounters& counters) { ++counters.io_errors; });
  if (status == IoStatus::kStall) static_cast<void>(transport_->clear_stall());
  clock_.sleep_until(std::min(deadline, pause_until_));
}

void DeviceTracker::close(TrackerState state, std::string detail) {
  transport_.reset();
  commands_.clear();
  next_command_ = 0;
  const double spread = 1 + kBackoffSpread * (2 * random_.uniform() - 1);
  retry_at_ = clock_.now() + from_seconds(to_seconds(backoff_) * spread);
  backoff_ = std::min(2 * backoff_, kLongestBackoff);
  set_state(state, std::move(detail));
}

}  // namespace veneer::tracking
