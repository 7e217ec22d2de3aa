// SPDX-License-Identifier: Apache-2.0
#include "daemon/pacer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod{16'666'667};

Duration ns(double value) { return Duration{std::llround(value)}; }

/// True refreshes and what the display's stamps say of them.
struct Display {
  double period_ns = 16'666'667;
  double drift = 0;      // of the period, relative, a refresh
  double jitter_ns = 0;  // standard deviation of a stamp
  double next_ns = 5e6;
  std::mt19937 random{7};
  Time truth() const { return Time{ns(next_ns)}; }
  Time stamp() {
    std::normal_distribution<double> noise(0, jitter_ns);
    return Time{ns(next_ns + (jitter_ns > 0 ? noise(random) : 0))};
  }
  void step() {
    next_ns += period_ns;
    period_ns *= 1 + drift;
  }
};

TEST(RefreshClock, PredictsAnExactDisplayExactly) {
  RefreshClock clock(kPeriod);
  Display display;
  for (int i = 0; i < 200; ++i, display.step()) {
    if (i > 0) {
      EXPECT_NEAR(
          to_seconds(clock.next_after(display.truth() - kPeriod / 2) - display.truth()), 0, 1e-6);
    }
    clock.add(display.stamp());
  }
}

TEST(RefreshClock, AveragesJitter) {
  RefreshClock clock(kPeriod);
  Display display;
  display.jitter_ns = 200e3;
  double squares = 0;
  int measured = 0;
  for (int i = 0; i < 4000; ++i, display.step()) {
    if (i > 200) {
      const double error =
          to_seconds(clock.next_after(display.truth() - kPeriod / 2) - display.truth());
      squares += error * error;
      ++measured;
    }
    clock.add(display.stamp());
  }
  // What an alpha-beta filter leaves of white noise in its prediction (Kalata 1984): for gains a
  // and b the variance (2 a^2 + 2 b + a b) / (a (4 - 2 a - b)) of a stamp's.
  constexpr double kA = 0.2;
  constexpr double kB = 0.01;
  const double expected = std::sqrt((2 * kA * kA + 2 * kB + kA * kB) / (kA * (4 - 2 * kA - kB)));
  // 3800 samples of which some ten are of one draw: 400 free ones, so 4 % at one sigma.
  EXPECT_NEAR(std::sqrt(squares / measured) / 200e-6, expected, 0.12 * expected);
}

TEST(RefreshClock, LearnsAPeriodThatIsNotTheModes) {
  RefreshClock clock(kPeriod);
  Display display;
  display.period_ns *= 1.001;
  for (int i = 0; i < 600; ++i, display.step()) clock.add(display.stamp());
  EXPECT_NEAR(static_cast<double>(clock.period().count()), display.period_ns, 50);
}

TEST(RefreshClock, FollowsADriftingPeriodAndMissedStamps) {
  RefreshClock clock(kPeriod);
  Display display;
  display.drift = 1e-7;  // 6 ppm a second: a crystal that warms up faster than any does
  std::mt19937 random(3);
  for (int i = 0; i < 5000; ++i, display.step()) {
    if (i > 200) {
      EXPECT_NEAR(
          to_seconds(clock.next_after(display.truth() - kPeriod / 2) - display.truth()), 0, 20e-6)
          << i;
    }
    if (random() % 10 < 7) clock.add(display.stamp());
  }
}

TEST(RefreshClock, DoesNotBelieveOneStrangeStampButThreeOfThem) {
  RefreshClock clock(kPeriod);
  Display display;
  for (int i = 0; i < 100; ++i, display.step()) clock.add(display.stamp());
  const Time before = clock.next_after(display.truth() - kPeriod / 2);
  clock.add(display.truth() + 7ms);
  display.step();
  EXPECT_NEAR(
      to_seconds(clock.next_after(before + kPeriod / 2) - before), to_seconds(kPeriod), 1e-6);
  for (int i = 0; i < 4; ++i, display.step()) clock.add(display.truth() + 7ms);
  EXPECT_NEAR(to_seconds(clock.next_after(display.truth()) - (display.truth() + 7ms)), 0, 1e-4)
      << "the display has begun anew";
}

TEST(RefreshClock, ToldTheSameStampTwiceStaysWhereItIs) {
  RefreshClock once(kPeriod);
  RefreshClock twice(kPeriod);
  Display display;
  display.jitter_ns = 100e3;
  for (int i = 0; i < 100; ++i, display.step()) {
    const Time stamp = display.stamp();
    once.add(stamp);
    twice.add(stamp);
    twice.add(stamp);
  }
  EXPECT_EQ(once.next_after(display.truth()), twice.next_after(display.truth()));
}

TEST(RefreshClock, NextIsAlwaysAfterAndWithinAPeriod) {
  RefreshClock clock(kPeriod);
  clock.add(Time{1s});
  std::mt19937 random(11);
  for (int i = 0; i < 10000; ++i) {
    const Time when{Duration{static_cast<std::int64_t>(random()) % 3'000'000'000}};
    const Time next = clock.next_after(when);
    EXPECT_GT(next, when);
    EXPECT_LE(next - when, kPeriod + 2ns);
  }
}

/// A machine that draws for a while and a display that shows what was ready: frames of `draw_ms`,
/// now and then of `spike_ms`.
struct Result {
  int missed = 0;
  int frames = 0;
  std::uint64_t skipped = 0;
  double wait_ms = 0;  // mean from pose to light
  bool two_in_one = false;
};
Result simulate(Pacer& pacer,
                Display display,
                int frames,
                double draw_ms,
                double noise_ms,
                int spike_every = 0,
                double spike_ms = 0) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 1);
  Result result;
  Time now{1ms};
  Time last_shown = Time::min();
  for (int i = 0; i < frames; ++i) {
    const Pacer::Plan plan = pacer.plan(static_cast<std::uint64_t>(i), now);
    result.skipped += plan.skipped;
    const bool spike = spike_every > 0 && i % spike_every == spike_every - 1;
    const double took_ms = (spike ? spike_ms : draw_ms) + std::abs(noise(random)) * noise_ms;
    const Time done = plan.wake + ns(took_ms * 1e6);
    pacer.took(done - plan.wake);
    while (display.truth() <= done || display.truth() <= last_shown) display.step();
    const Time shown = display.truth();
    result.two_in_one |= shown == last_shown;
    last_shown = shown;
    result.wait_ms += 1e3 * to_seconds(shown - plan.wake) / frames;
    // The flip is waited for before the next frame, as outputs do.
    now = shown + 100us;
    if (pacer.shown(static_cast<std::uint64_t>(i), display.stamp())) ++result.missed;
    ++result.frames;
  }
  return result;
}

TEST(Pacer, ReadsThePoseAsLateAsDrawingAllows) {
  Pacer pacer(kPeriod, true);
  Display display;
  display.jitter_ns = 20e3;
  (void)simulate(pacer, display, 2000, 4, 0.1);
  // Four milliseconds of drawing, its noise, and a margin that has shrunk to its least.
  EXPECT_LT(1e3 * to_seconds(pacer.lead()), 4 + 0.3 + 0.7);
  EXPECT_GT(1e3 * to_seconds(pacer.lead()), 4);
}

TEST(Pacer, LateReadingIsYoungerThanEarlyByNearlyTheTimeThatIsLeft) {
  Pacer late(kPeriod, true);
  Pacer early(kPeriod, false);
  Display display;
  const Result late_result = simulate(late, display, 1000, 4, 0.1);
  const Result early_result = simulate(early, display, 1000, 4, 0.1);
  EXPECT_GT(early_result.wait_ms - late_result.wait_ms, 16.6 - 4 - 2.5);
  EXPECT_LT(late_result.wait_ms, 4 + 2.5);
}

TEST(Pacer, ShowsOneFrameARefreshAndMissesFew) {
  for (const double jitter_ns : {0.0, 50e3, 150e3}) {
    Pacer pacer(kPeriod, true);
    Display display;
    display.jitter_ns = jitter_ns;
    display.period_ns *= 1.0005;
    const Result result = simulate(pacer, display, 5000, 6, 0.2);
    EXPECT_FALSE(result.two_in_one);
    EXPECT_LE(result.missed, 75) << "1.5 %; jitter " << jitter_ns;
    EXPECT_LE(result.skipped, 100U) << jitter_ns;
  }
}

TEST(Pacer, TheMarginGrowsAtAMissAndShrinksAgain) {
  Pacer pacer(kPeriod, true);
  Display display;
  (void)simulate(pacer, display, 3000, 5, 0.05);
  const Duration calm = pacer.margin();
  EXPECT_EQ(calm, 300us);
  (void)pacer.plan(10000, Time{100s});
  EXPECT_TRUE(pacer.shown(10000, Time{102s}));
  EXPECT_GT(pacer.margin(), calm);
  EXPECT_FALSE(pacer.shown(10000, Time{103s})) << "told already";
}

TEST(Pacer, RareSpikesDoNotMakeEveryFrameEarly) {
  Pacer pacer(kPeriod, true);
  const Result result = simulate(pacer, Display{}, 3000, 4, 0.1, 300, 12);
  EXPECT_LE(result.missed, 3000 / 300 + 30);
  EXPECT_LT(1e3 * to_seconds(pacer.lead()), 8);
}

TEST(Pacer, AFrameLongerThanAPeriodTakesEverySecondRefresh) {
  Pacer pacer(kPeriod, true);
  const Result result = simulate(pacer, Display{}, 500, 20, 0.2);
  EXPECT_FALSE(result.two_in_one);
  EXPECT_NEAR(static_cast<double>(result.skipped), 500, 25);
}

TEST(Pacer, AfterSlowFramesTheFullRateIsBackAfterAFew) {
  Pacer pacer(kPeriod, true);
  Display display;
  Time now{1ms};
  Time shown = Time::min();
  std::uint64_t number = 0;
  // Each from its pose to the display; returns how many refreshes were left out.
  const auto draw = [&](int frames, Duration took) {
    std::uint64_t skipped = 0;
    for (int i = 0; i < frames; ++i, ++number) {
      const Pacer::Plan plan = pacer.plan(number, now);
      skipped += plan.skipped;
      pacer.took(took);
      while (display.truth() <= plan.wake + took || display.truth() <= shown) display.step();
      shown = display.truth();
      now = shown + 100us;
      (void)pacer.shown(number, display.stamp());
    }
    return skipped;
  };
  (void)draw(200, 4ms);
  (void)draw(20, 80ms);
  // Eight frames that still take five refreshes each for granted.
  EXPECT_LE(draw(10, 4ms), 50U);
  EXPECT_EQ(draw(100, 4ms), 0U);
}

TEST(Pacer, NoMarginLeavesOutRefreshes) {
  Pacer pacer(kPeriod, true);
  Display display;
  (void)simulate(pacer, display, 500, 11, 0.1, 5, 14);
  // Every fifth frame takes 3 ms more, so that the margin is as large as it gets.
  const Result result = simulate(pacer, display, 500, 11, 0.1, 5, 14);
  EXPECT_LT(pacer.lead(), kPeriod);
  EXPECT_LE(result.skipped, 25U);
}

TEST(Pacer, AfterAPauseThereIsNoBurst) {
  Pacer pacer(kPeriod, true);
  Display display;
  (void)simulate(pacer, display, 100, 4, 0.1);
  pacer.start_over();
  Time last = Time::min();
  Time now{100s};
  for (std::uint64_t i = 100; i < 110; ++i) {
    const Pacer::Plan plan = pacer.plan(i, now);
    EXPECT_GE(plan.wake, now);
    if (i > 100) {
      EXPECT_GT(plan.refresh - last, kPeriod * 3 / 4);
    }
    last = plan.refresh;
    now = plan.wake + 4ms;
    pacer.took(4ms);
  }
}

}  // namespace
}  // namespace veneer::daemon
