// SPDX-License-Identifier: Apache-2.0
#include "quality/governor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "base/random.h"

namespace veneer::quality {
namespace {

using namespace std::chrono_literals;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A machine whose frames take what a script says: the cost of the rung, times the load of the
/// moment, times noise.
struct Machine {
  std::vector<double> cost_ms;                ///< of each rung, without load
  std::function<double(double second)> load;  ///< 1: none
  double noise = 0.03;                        ///< standard deviation, of a frame's cost
  double hiccups = 0.0;                       ///< part of the frames that take five times as long
};

struct Step {
  double second;
  std::size_t from;
  std::size_t to;
};

struct Drive {
  struct Frame {
    double second;
    Governor::Choice choice;
    double ms;
    double cheapest_ms;  ///< what the last rung would have taken, without noise
  };
  std::vector<Frame> frames;
  std::vector<Step> steps;

  /// Of the frames that are not within `settle` seconds after a step or after one of `changes`.
  [[nodiscard]] double inside(double deadline_ms,
                              const std::vector<double>& changes,
                              double settle) const {
    int count = 0;
    int in_time = 0;
    for (const Frame& frame : frames) {
      const auto soon_after = [&](double second) {
        return frame.second >= second && frame.second < second + settle;
      };
      const bool unsteady =
          std::ranges::any_of(changes, soon_after) ||
          std::ranges::any_of(steps, [&](const Step& s) { return soon_after(s.second); });
      if (unsteady) continue;
      ++count;
      in_time += frame.ms <= deadline_ms ? 1 : 0;
    }
    return count > 0 ? static_cast<double>(in_time) / count : 0.0;
  }
};

Drive drive(Governor& governor, const Machine& machine, double seconds, std::uint64_t seed) {
  constexpr double kFrame_s = 1.0 / 60;
  Pcg32 random(seed);
  const auto normal = [&random] {  // Irwin-Hall, twelve: near enough to normal
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += random.uniform();
    return sum;
  };
  Drive run;
  std::size_t rung = governor.rung();
  for (double t = 0; t < seconds; t += kFrame_s) {
    const Governor::Choice choice = governor.next(Time{} + from_seconds(t));
    EXPECT_LT(choice.level, machine.cost_ms.size());
    EXPECT_LT(choice.next_level, machine.cost_ms.size());
    EXPECT_GE(choice.fade, 0.0);
    EXPECT_LT(choice.fade, 1.0);
    const double load = machine.load(t);
    double ms = machine.cost_ms[choice.level] * (1 - choice.fade) +
                machine.cost_ms[choice.next_level] * choice.fade;
    ms *= load * std::max(0.1, 1 + machine.noise * normal());
    if (random.uniform() < machine.hiccups) ms *= 5;
    governor.took(choice, ms);
    run.frames.push_back({t, choice, ms, machine.cost_ms.back() * load});
    if (governor.rung() != rung) run.steps.push_back({t, rung, governor.rung()});
    rung = governor.rung();
  }
  return run;
}

/// Rungs that cost 12, 8, 5 and 3 ms; the deadline is 1.3 times the cheapest under a load of 3.
constexpr double kDeadline_ms = 1.3 * 3 * 3.0;
const std::vector<double> kCosts{12, 8, 5, 3};
GovernorOptions with_deadline(double ms = kDeadline_ms) {
  GovernorOptions options;
  options.mode = GovernorMode::kDeadline;
  options.deadline_ms = ms;
  return options;
}

void expect_calm(const Drive& run) {
  for (std::size_t i = 1; i < run.steps.size(); ++i)
    EXPECT_GE(run.steps[i].second - run.steps[i - 1].second, 1.0 - 1e-9)
        << "at most one step a second";
}

TEST(Governor, HoldsTheDeadlineAtThreeTenthsOverTheCheapestUnderAnyConstantLoad) {
  for (std::uint64_t seed = 0; seed < 20; ++seed)
    for (const double load : {0.3, 0.9, 1.1, 1.5, 2.0, 2.6, 3.0}) {
      Governor governor(with_deadline(), kCosts);
      const Drive run = drive(governor, {kCosts, [&](double) { return load; }}, 60, seed);
      EXPECT_GE(run.inside(kDeadline_ms, {0.0}, 2.0), 0.99) << load << " " << seed;
      expect_calm(run);
      // Under a load that stays, it finds its rung and keeps it.
      int late_steps = 0;
      for (const Step& step : run.steps) late_steps += step.second > 15 ? 1 : 0;
      EXPECT_LE(late_steps, 1) << load << " " << seed;
    }
}

TEST(Governor, TakesTheBestRungThatHasRoom) {
  for (const auto& [load, rung] : {std::pair{0.5, 0U}, {1.2, 1U}, {1.9, 2U}, {3.0, 3U}}) {
    Governor governor(with_deadline(), kCosts);
    static_cast<void>(drive(governor, {kCosts, [l = load](double) { return l; }}, 30, 1));
    EXPECT_EQ(governor.rung(), rung) << load;
  }
}

TEST(Governor, StepsDownWhenTheLoadComesAndBackWhenItHasGone) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Governor governor(with_deadline(), kCosts);
    const auto load = [](double t) { return t >= 20 && t < 50 ? 3.0 : 0.8; };
    const Drive run = drive(governor, {kCosts, load}, 80, seed);
    EXPECT_GE(run.inside(kDeadline_ms, {0.0, 20.0, 50.0}, 2.0), 0.99) << seed;
    expect_calm(run);
    ASSERT_GE(run.steps.size(), 2U);
    EXPECT_GE(run.steps.front().second, 20.0);
    EXPECT_LE(run.steps.front().second, 20.2) << "half of six frames";
    EXPECT_EQ(governor.rung(), 0U);
    EXPECT_LE(run.steps.back().second, 55.0) << "back within five seconds";
  }
}

TEST(Governor, FollowsALoadThatGrowsAndFallsSlowly) {
  Governor governor(with_deadline(), kCosts);
  const auto load = [](double t) { return 1.9 - 1.1 * std::cos(t / 120 * 2 * 3.14159265); };
  const Drive run = drive(governor, {kCosts, load}, 120, 3);
  EXPECT_GE(run.inside(kDeadline_ms, {}, 2.0), 0.99);
  expect_calm(run);
  EXPECT_LE(run.steps.size(), 10U) << "three rungs down, three up, and little between";
}

TEST(Governor, IsNotDrivenByALoadThatComesAndGoes) {
  // Five seconds on, five off: without a memory it would go with it, 120 steps.
  Governor governor(with_deadline(), kCosts);
  const auto load = [](double t) { return std::fmod(t, 10.0) < 5.0 ? 3.0 : 0.8; };
  const Drive run = drive(governor, {kCosts, load}, 600, 5);
  expect_calm(run);
  int later = 0;
  for (const Step& step : run.steps) later += step.second > 300 ? 1 : 0;
  EXPECT_LE(later, 10) << "of " << run.steps.size();
}

TEST(Governor, LearnsRatiosThatWereMeasuredElsewhere) {
  // In truth the rungs cost what kCosts says.
  for (const std::vector<double>& believed : std::vector<std::vector<double>>{
           {24, 8, 5, 3}, {6, 5, 4, 3}, {12, 16, 10, 6}, {12, 4, 2.5, 1.5}, {1, 1, 1, 1}})
    for (const double load : {1.2, 1.9, 2.9}) {
      Governor governor(with_deadline(), believed);
      const Drive run = drive(governor, {kCosts, [&](double) { return load; }}, 200, 7);
      expect_calm(run);
      EXPECT_GE(run.inside(kDeadline_ms, {0.0}, 2.0), 0.97) << believed[0] << " " << load;
      int late_steps = 0;
      for (const Step& step : run.steps) late_steps += step.second > 60 ? 1 : 0;
      EXPECT_LE(late_steps, 4) << believed[0] << " " << load;
    }
}

TEST(Governor, OneLateFrameIsNoReason) {
  Governor governor(with_deadline(), kCosts);
  Machine machine{kCosts, [](double) { return 0.6; }};
  machine.hiccups = 0.005;
  const Drive run = drive(governor, machine, 120, 11);
  EXPECT_TRUE(run.steps.empty());
}

TEST(Governor, FadesFromOneRungToTheOther) {
  Governor governor(with_deadline(), kCosts);
  const Drive run = drive(governor, {kCosts, [](double) { return 3.0; }}, 3, 1);
  ASSERT_FALSE(run.steps.empty());
  double last = 0;
  int fading = 0;
  for (const Drive::Frame& frame : run.frames) {
    if (frame.choice.level == frame.choice.next_level) {
      EXPECT_EQ(frame.choice.fade, 0.0);
      last = 0;
      continue;
    }
    EXPECT_GT(frame.choice.fade, last);
    last = frame.choice.fade;
    ++fading;
  }
  EXPECT_EQ(fading, static_cast<int>(run.steps.size()) * GovernorOptions{}.fade_frames);
}

TEST(Governor, SaysWhenNothingCheaperIsLeft) {
  Governor governor(with_deadline(), kCosts);
  EXPECT_FALSE(governor.is_overloaded());
  static_cast<void>(drive(governor, {kCosts, [](double) { return 10.0; }}, 10, 1));
  EXPECT_EQ(governor.rung(), 3U);
  EXPECT_TRUE(governor.is_overloaded());
  Governor one(with_deadline(), {2.0});
  static_cast<void>(drive(one, {{2.0}, [](double) { return 10.0; }}, 10, 1));
  EXPECT_EQ(one.rung(), 0U);
  EXPECT_EQ(one.steps(), 0U);
  EXPECT_TRUE(one.is_overloaded());
}

TEST(Governor, StaysWhereItIsToldTo) {
  GovernorOptions options = with_deadline();
  options.mode = GovernorMode::kFixed;
  options.fixed_rung = 2;
  Governor fixed(options, kCosts);
  EXPECT_TRUE(drive(fixed, {kCosts, [](double) { return 10.0; }}, 10, 1).steps.empty());
  EXPECT_EQ(fixed.rung(), 2U);
  options.fixed_rung = 9;
  EXPECT_EQ(Governor(options, kCosts).rung(), 3U) << "there are but four";
  options.mode = GovernorMode::kBest;
  Governor best(options, kCosts);
  EXPECT_TRUE(drive(best, {kCosts, [](double) { return 10.0; }}, 10, 1).steps.empty());
  EXPECT_EQ(best.rung(), 0U);
}

TEST(Governor, GoesOnWhereAnotherWas) {
  Governor governor(with_deadline(), kCosts);
  governor.begin_on(2);
  EXPECT_EQ(governor.next(Time{}), (Governor::Choice{2, 2, 0}));
  governor.begin_on(7);
  EXPECT_EQ(governor.rung(), 3U);
  GovernorOptions options = with_deadline();
  options.mode = GovernorMode::kBest;
  Governor best(options, kCosts);
  best.begin_on(2);
  EXPECT_EQ(best.rung(), 0U) << "it is told to stay there";
  // Under a shorter deadline it finds another rung.
  Governor hurried(with_deadline(), kCosts);
  hurried.set_deadline(4);
  static_cast<void>(drive(hurried, {kCosts, [](double) { return 1.0; }}, 20, 1));
  EXPECT_EQ(hurried.rung(), 3U);
}

TEST(Governor, MakesNothingOfFramesThatNobodyTimed) {
  Governor governor(with_deadline(), kCosts);
  const double nonsense[] = {kNaN, -1.0, std::numeric_limits<double>::infinity()};
  for (int i = 0; i < 600; ++i) {
    const Governor::Choice choice = governor.next(Time{} + i * 16ms);
    EXPECT_EQ(choice, Governor::Choice{});
    governor.took(choice, nonsense[i % 3]);
  }
  // Frames that take nothing leave it on the best rung.
  for (int i = 600; i < 1200; ++i) governor.took(governor.next(Time{} + i * 16ms), 0.0);
  EXPECT_EQ(governor.rung(), 0U);
}

TEST(Governor, OutlivesJumpsOfTime) {
  Governor governor(with_deadline(), kCosts);
  Pcg32 random(3);
  Time now{};
  for (int i = 0; i < 20'000; ++i) {
    now += 16ms;
    if (random.uniform() < 0.01) now += from_seconds(100 * random.uniform() - 50);
    const Governor::Choice choice = governor.next(now);
    ASSERT_LT(std::max(choice.level, choice.next_level), kCosts.size());
    governor.took(choice, kCosts[choice.level] * (i % 4000 < 2000 ? 3 : 1));
  }
  // A step long before the clock was set back does not forbid steps for ever.
  governor.took(governor.next(Time{}), 1.0);
  const Drive run = drive(governor, {kCosts, [](double) { return 0.5; }}, 30, 1);
  EXPECT_EQ(governor.rung(), 0U);
}

TEST(GovernorMode, IsNamed) {
  for (const auto mode : {GovernorMode::kFixed, GovernorMode::kDeadline, GovernorMode::kBest})
    EXPECT_EQ(parse_governor_mode(name_of(mode)), mode);
  const auto wrong = parse_governor_mode("fast");
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().what.find("\"deadline\""), std::string::npos);
}

}  // namespace
}  // namespace veneer::quality
