// SPDX-License-Identifier: Apache-2.0
#include "tracking/device/clock_mapper.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"

namespace veneer::tracking {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr DeviceClock kFrames{WrappingCounter{32}, 1.0 / 240};
constexpr DeviceClock kMicroseconds{WrappingCounter{32}, 1e-6};
constexpr Time kStart{seconds(5000)};

/// A device whose clock runs at (1 - skew) of ours, and whose samples arrive late.
struct Device {
  double skew = 0;
  double rate_hz = 240;
  std::uint64_t first_tick = 0;
  double delay_s = 1e-3;     ///< the least
  double jitter_s = 0.2e-3;  ///< mean of the exponential on top of it
  double spike_share = 0;    ///< of samples that are 5 to 50 ms late
  int burst = 1;             ///< so many arrive together
  Pcg32 random{3};

  struct Sample {
    std::uint64_t ticks;
    Time measured;
    Time arrival;
  };
  /// Microsecond ticks; arrivals in order, as a stream has them.
  std::vector<Sample> run(int count) {
    std::vector<Sample> samples;
    Time latest = kStart;
    for (int i = 0; i < count; ++i) {
      const double device_s = i / rate_hz;
      const Time measured = kStart + from_seconds(device_s * (1 + skew));
      double delay = delay_s - jitter_s * std::log1p(-random.uniform());
      if (random.uniform() < spike_share) delay += 5e-3 + 45e-3 * random.uniform();
      latest = std::max(latest, measured + from_seconds(delay));
      const auto ticks = first_tick + static_cast<std::uint64_t>(std::llround(device_s * 1e6));
      samples.push_back({ticks & 0xFFFFFFFFU, measured, latest});
    }
    for (int i = count - 1; i >= 0; --i) {  // all of a burst arrive with its last
      const int last = std::min(count - 1, i / burst * burst + burst - 1);
      samples[static_cast<std::size_t>(i)].arrival =
          samples[static_cast<std::size_t>(last)].arrival;
    }
    return samples;
  }
};

/// The greatest error of the mapped times after lock, the least delay taken off, in seconds; NaN
/// if it never locked.
double worst_error(Device device, int count) {
  ClockMapper mapper(kMicroseconds);
  double worst = std::numeric_limits<double>::quiet_NaN();
  for (const Device::Sample& sample : device.run(count)) {
    const ClockMapper::Mapped mapped = mapper.map(sample.ticks, sample.arrival);
    EXPECT_EQ(mapped.verdict, ClockMapper::Verdict::kMapped);
    EXPECT_LE(mapped.time, sample.arrival);
    if (!mapped.locked) continue;
    const double error = std::abs(to_seconds(mapped.time - sample.measured) - device.delay_s);
    worst = std::isnan(worst) ? error : std::max(worst, error);
  }
  return worst;
}

TEST(Widen, GoesOnOverTheWrap) {
  for (const int bits : {1, 8, 24, 32, 63, 64}) {
    const WrappingCounter counter{bits};
    std::optional<std::int64_t> last;
    const std::uint64_t mask = bits == 64 ? ~0ULL : (1ULL << bits) - 1;
    const std::uint64_t start = mask - 1;
    last = widen(counter, start, last);
    EXPECT_EQ(static_cast<std::uint64_t>(*last), start) << bits;
    for (int i = 1; i < 6 && bits > 1; ++i) {
      const std::int64_t next =
          widen(counter, (start + static_cast<std::uint64_t>(i)) & mask, last);
      EXPECT_EQ(next - *last, 1) << bits;
      EXPECT_EQ(widen(counter, static_cast<std::uint64_t>(*last) & mask, next), *last) << bits;
      last = next;
    }
  }
}

TEST(ClockMapper, IsExactWithoutDelays) {
  EXPECT_LT(worst_error({.delay_s = 0, .jitter_s = 0}, 2400), 1e-6);  // ticks are microseconds
}

TEST(ClockMapper, ErrorStaysUnderAFifthOfAMillisecond) {
  // The bound, with everything that it names: skew, spikes, bursts of eight.
  for (const double skew : {-200e-6, 0.0, 200e-6}) {
    for (const double spikes : {0.0, 0.05}) {
      for (const double rate : {60.0, 240.0, 1000.0}) {
        const Device device{.skew = skew, .rate_hz = rate, .spike_share = spikes};
        EXPECT_LT(worst_error(device, static_cast<int>(20 * rate)), 0.2e-3)
            << skew << " " << spikes << " " << rate;
      }
      const Device bursts{.skew = skew, .spike_share = spikes, .burst = 8};
      EXPECT_LT(worst_error(bursts, 4800), 0.2e-3) << skew << " " << spikes;
    }
  }
}

TEST(ClockMapper, FindsTheSkew) {
  Device device{.skew = 150e-6, .spike_share = 0.02};
  ClockMapper mapper(kMicroseconds);
  for (const Device::Sample& sample : device.run(4800)) {
    (void)mapper.map(sample.ticks, sample.arrival);
  }
  EXPECT_NEAR(mapper.skew(), 150e-6, 20e-6);  // 0.02 ms of jitter over the second around the mean
}

TEST(ClockMapper, ADelayMovesNothing) {
  Device device{.jitter_s = 0.05e-3};
  ClockMapper calm(kMicroseconds);
  ClockMapper disturbed(kMicroseconds);
  const std::vector<Device::Sample> samples = device.run(2400);
  Duration worst{};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    // Between the second and the third second one in ten is up to 50 ms late. Its own time must
    // not show it; the least delay of each bin is the same.
    const bool spike = i > 480 && i < 720 && i % 10 == 3;
    const Time a = calm.map(samples[i].ticks, samples[i].arrival).time;
    const Time b =
        disturbed.map(samples[i].ticks, samples[i].arrival + milliseconds(spike ? 45 : 0)).time;
    if (i > 240) worst = std::max(worst, a > b ? a - b : b - a);
  }
  EXPECT_LT(worst, std::chrono::microseconds(50));
}

TEST(ClockMapper, WrapsWithoutASeam) {
  Device device{.first_tick = 0xFFFFFFFFU - 3'000'000U, .jitter_s = 0};
  ClockMapper mapper(kMicroseconds);
  Time previous{};
  for (const Device::Sample& sample : device.run(2400)) {
    const auto mapped = mapper.map(sample.ticks, sample.arrival);
    ASSERT_EQ(mapped.verdict, ClockMapper::Verdict::kMapped);
    if (previous != Time{}) {
      EXPECT_NEAR(to_seconds(mapped.time - previous), 1.0 / 240, 2e-6);
    }
    previous = mapped.time;
  }
}

/// Runs a mapper to its lock; returns the tick and arrival of the last sample.
std::pair<std::uint64_t, Time> lock(ClockMapper& mapper, std::uint64_t first, int count = 480) {
  std::uint64_t tick = first;
  Time arrival = kStart;
  for (int i = 0; i < count; ++i) {
    tick = first + static_cast<std::uint64_t>(i);
    arrival = kStart + from_seconds(i / 240.0);
    EXPECT_EQ(mapper.map(tick, arrival).verdict, ClockMapper::Verdict::kMapped);
  }
  EXPECT_TRUE(mapper.locked());
  return {tick, arrival};
}

TEST(ClockMapper, OneWildTickIsAnOutlierAndLeavesNoTrace) {
  for (const std::uint64_t wild : {std::uint64_t{0},
                                   std::uint64_t{100},
                                   std::uint64_t{0x80000000},
                                   std::uint64_t{0xFFFFFFFF}}) {
    ClockMapper mapper(kFrames);
    const auto [tick, arrival] = lock(mapper, 100000);
    EXPECT_EQ(mapper.map(wild, arrival + milliseconds(4)).verdict, ClockMapper::Verdict::kOutlier);
    const auto next = mapper.map(tick + 2, arrival + from_seconds(2 / 240.0));
    EXPECT_EQ(next.verdict, ClockMapper::Verdict::kMapped);
    EXPECT_TRUE(next.locked);
    EXPECT_NEAR(to_seconds(next.time - arrival), 2 / 240.0, 1e-6) << wild;
  }
}

TEST(ClockMapper, ARestartIsTakenAtItsSecondSample) {
  ClockMapper mapper(kFrames);
  const auto [tick, arrival] = lock(mapper, 5'000'000);
  const Time later = arrival + seconds(1);
  EXPECT_EQ(mapper.map(0, later).verdict, ClockMapper::Verdict::kOutlier);
  const auto restarted = mapper.map(1, later + from_seconds(1 / 240.0));
  EXPECT_EQ(restarted.verdict, ClockMapper::Verdict::kRestarted);
  EXPECT_FALSE(restarted.locked);
  EXPECT_EQ(restarted.time, later + from_seconds(1 / 240.0));
  EXPECT_EQ(mapper.map(2, later + from_seconds(2 / 240.0)).verdict, ClockMapper::Verdict::kMapped);
}

TEST(ClockMapper, AStepOfThePeersWallClockIsARestart) {
  for (const int step_h : {-1, 1}) {
    ClockMapper mapper(DeviceClock{WrappingCounter{64}, 1e-6});
    std::uint64_t wall_us = 1'700'000'000'000'000ULL;
    Time arrival = kStart;
    const auto next = [&] {
      wall_us += 10'000;
      arrival += milliseconds(10);
      return mapper.map(wall_us, arrival);
    };
    for (int i = 0; i < 100; ++i) EXPECT_EQ(next().verdict, ClockMapper::Verdict::kMapped);
    wall_us += static_cast<std::uint64_t>(std::chrono::microseconds(hours(step_h)).count());
    EXPECT_EQ(next().verdict, ClockMapper::Verdict::kOutlier);
    EXPECT_EQ(next().verdict, ClockMapper::Verdict::kRestarted);
    EXPECT_EQ(next().verdict, ClockMapper::Verdict::kMapped);
  }
}

TEST(ClockMapper, SmallStepsBackAreLateSamplesNotRestarts) {
  ClockMapper mapper(kFrames);
  const auto [tick, arrival] = lock(mapper, 1000);
  for (const std::uint64_t back : {1U, 5U, 10U}) {
    const auto mapped = mapper.map(tick - back, arrival + milliseconds(1));
    EXPECT_EQ(mapped.verdict, ClockMapper::Verdict::kMapped);
    EXPECT_NEAR(to_seconds(arrival - mapped.time), static_cast<double>(back) / 240, 1e-4);
  }
}

TEST(ClockMapper, DoesNotLockOnAScatteredClock) {
  Device device{.delay_s = 1e-3, .jitter_s = 30e-3};
  ClockMapper mapper(kMicroseconds);
  int samples = 0;
  int locked = 0;
  for (const Device::Sample& sample : device.run(64)) {
    ++samples;
    locked += mapper.map(sample.ticks, sample.arrival).locked ? 1 : 0;
  }
  EXPECT_EQ(samples, 64);
  EXPECT_EQ(locked, 0);
}

TEST(ClockMapper, TheMappedTimeMovesSlowlyWhenTheDelayChangesForGood) {
  ClockMapper mapper(kFrames);
  auto [tick, arrival] = lock(mapper, 1000);
  double previous_offset = 0;
  for (int i = 1; i < 240 * 30; ++i) {
    const Time measured = arrival + from_seconds(i / 240.0);
    const auto mapped =
        mapper.map(tick + static_cast<std::uint64_t>(i), measured + milliseconds(3));
    const double offset = to_seconds(mapped.time - measured);
    // A step of 1/240 s may change it by 200 us/s, and by the slope that is believed in.
    EXPECT_LE(std::abs(offset - previous_offset), (200e-6 + 500e-6) / 240 + 2e-9) << i;
    previous_offset = offset;
  }
  EXPECT_NEAR(previous_offset, 3e-3, 0.2e-3);  // half a minute later it has arrived
}

TEST(ClockMapper, AClockThatWasSetBackWhileNobodyLookedIsFoundAgain) {
  // Nothing is seen for 12 s, in which the device's clock loses 10: what comes then looks late.
  ClockMapper mapper(kMicroseconds);
  Time arrival = kStart;
  std::uint64_t ticks = 0;
  const auto next = [&] {
    arrival += milliseconds(10);
    ticks += 10'000;
    return mapper.map(ticks, arrival);
  };
  for (int i = 0; i < 500; ++i) EXPECT_EQ(next().verdict, ClockMapper::Verdict::kMapped);
  EXPECT_TRUE(mapper.locked());
  arrival += seconds(12);
  ticks += 2'000'000;
  int restarts = 0;
  ClockMapper::Mapped mapped;
  for (int i = 0; i < 600; ++i) {
    mapped = next();
    restarts += mapped.verdict == ClockMapper::Verdict::kRestarted ? 1 : 0;
  }
  EXPECT_EQ(restarts, 1);
  EXPECT_TRUE(mapped.locked);
  EXPECT_LT(arrival - mapped.time, milliseconds(1));
}

TEST(ClockMapper, HostileTicksHurtNobody) {
  for (const int bits : {1, 8, 32, 64}) {
    Pcg32 random(static_cast<std::uint64_t>(bits));
    ClockMapper mapper(DeviceClock{WrappingCounter{bits}, 1e-3});
    Time arrival = kStart;
    for (int i = 0; i < 20000; ++i) {
      arrival += from_seconds(1e-3 * random.uniform());
      const std::uint64_t ticks =
          (static_cast<std::uint64_t>(random.next()) << 32U) | random.next();
      const auto mapped = mapper.map(ticks, arrival);
      if (mapped.verdict != ClockMapper::Verdict::kOutlier) {
        EXPECT_LE(mapped.time, arrival);
      }
      EXPECT_LE(std::abs(mapper.skew()), 500e-6);
    }
  }
}

}  // namespace
}  // namespace veneer::tracking
