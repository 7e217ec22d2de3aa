// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>

namespace veneer {

/// An instant on CLOCK_MONOTONIC, in nanoseconds. All of Veneer's times are of this kind.
using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;
using Duration = std::chrono::nanoseconds;

[[nodiscard]] constexpr double to_seconds(Duration d) {
  return std::chrono::duration<double>(d).count();
}
[[nodiscard]] constexpr Duration from_seconds(double seconds) {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(seconds));
}

/// Where time comes from, so that tests and the virtual bench can run on a time of their own.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Time now() const = 0;
  virtual void sleep_until(Time wake) = 0;
};

/// CLOCK_MONOTONIC.
class SteadyClock final : public Clock {
 public:
  [[nodiscard]] Time now() const override;
  void sleep_until(Time wake) override;
};

/// A time that passes only when somebody sleeps on it: runs are repeatable whatever the machine.
/// now() is thread-safe; only one thread may sleep.
class VirtualClock final : public Clock {
 public:
  explicit VirtualClock(Time start = Time{}) : now_(start.time_since_epoch().count()) {}
  [[nodiscard]] Time now() const override { return Time{Duration{now_.load()}}; }
  /// Jumps to `wake`; a time in the past changes nothing.
  void sleep_until(Time wake) override;

 private:
  std::atomic<Duration::rep> now_;
};

/// How long the machine has slept since it was started, while CLOCK_MONOTONIC stood still:
/// CLOCK_BOOTTIME's lead. Two readings differ by less than a millisecond where it did not sleep.
[[nodiscard]] Duration time_asleep();

}  // namespace veneer
