// SPDX-License-Identifier: Apache-2.0
#include "base/clock.h"

#include <gtest/gtest.h>

#include <limits>

namespace veneer {
namespace {

using namespace std::chrono_literals;

TEST(VirtualClock, PassesOnlyWhenSomebodySleeps) {
  VirtualClock clock(Time{5s});
  EXPECT_EQ(clock.now(), Time{5s});
  clock.sleep_until(Time{5s} + 16ms);
  EXPECT_EQ(clock.now(), Time{5s} + 16ms);
}

TEST(VirtualClock, NeverGoesBack) {
  VirtualClock clock(Time{5s});
  clock.sleep_until(Time{1s});
  EXPECT_EQ(clock.now(), Time{5s});
}

TEST(SteadyClock, SleepsAtLeastAsLongAsAsked) {
  SteadyClock clock;
  const Time wake = clock.now() + 2ms;
  clock.sleep_until(wake);
  EXPECT_GE(clock.now(), wake);
}

TEST(Seconds, SurviveTheRoundTrip) {
  EXPECT_EQ(from_seconds(to_seconds(1234567us)), Duration(1234567us));
}

}  // namespace
}  // namespace veneer
