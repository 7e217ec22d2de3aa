// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/arrival_stamp.h"

#include <gtest/gtest.h>

#include "base/random.h"

namespace veneer::tracking {
namespace {

using namespace std::chrono_literals;

constexpr Time kOpened{100s};
constexpr Duration kEpoch = 20000 * 24h;  // what the wall clock shows at monotonic zero

ClockPair clocks_at(Time monotonic, Duration step = {}) {
  return {monotonic, kEpoch + monotonic.time_since_epoch() + step};
}

TEST(ArrivalStamp, IsTheMomentOfArrivalOnTheMonotonicClock) {
  ArrivalStamp stamps(kOpened);
  for (int i = 1; i < 100; ++i) {
    const Time arrived = kOpened + i * 5ms;
    const Duration stamp = kEpoch + arrived.time_since_epoch();
    EXPECT_EQ(stamps.arrival(stamp, clocks_at(arrived + 2ms)), arrived);
  }
}

TEST(ArrivalStamp, AStepOfTheWallClockCostsNoMoreThanTheWaitInTheQueue) {
  for (const Duration step : {Duration{1h}, Duration{-1h}, Duration{3s}, Duration{-50ms}}) {
    ArrivalStamp stamps(kOpened);
    const Time arrived = kOpened + 1s;
    const Time read = arrived + 2ms;
    stamps.queue_was_empty(arrived - 3ms);
    // The clock was set while the datagram lay in the queue...
    const Time during = stamps.arrival(kEpoch + arrived.time_since_epoch(), clocks_at(read, step));
    EXPECT_GE(during, arrived - 3ms) << step.count();
    EXPECT_LE(during, read) << step.count();
    // ...and is the same for all that follow.
    const Time next = read + 5ms;
    stamps.queue_was_empty(read + 1ms);
    EXPECT_EQ(stamps.arrival(kEpoch + next.time_since_epoch() + step, clocks_at(next + 1ms, step)),
              next);
  }
}

TEST(ArrivalStamp, NeverGoesBackNorAheadWhateverTheWallClockDoes) {
  Pcg32 random(7);
  ArrivalStamp stamps(kOpened);
  Time now = kOpened;
  Time last = kOpened;
  for (int i = 0; i < 10000; ++i) {
    now += Duration{random.next() % 10'000'000};
    if (random.next() % 4 == 0) stamps.queue_was_empty(now);
    const Duration stamp =
        kEpoch + now.time_since_epoch() +
        Duration{static_cast<std::int32_t>(random.next())} * (random.next() % 1000);
    const Time arrival = stamps.arrival(stamp, clocks_at(now));
    ASSERT_GE(arrival, last);
    ASSERT_LE(arrival, now);
    last = arrival;
  }
}

TEST(ArrivalStamp, TheClocksAreReadTogether) {
  const ClockPair first = ClockPair::now();
  const ClockPair second = ClockPair::now();
  EXPECT_GE(second.monotonic, first.monotonic);
  // Slewing changes the rate by 500 ppm at most; a preempted reading is off by as long as it took.
  const Duration difference =
      (second.realtime - first.realtime) - (second.monotonic - first.monotonic);
  EXPECT_LT(std::chrono::abs(difference), 100ms);
}

}  // namespace
}  // namespace veneer::tracking
