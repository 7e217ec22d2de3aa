// SPDX-License-Identifier: Apache-2.0
#include "cli/governor/drive.h"

#include <gtest/gtest.h>

#include <numeric>

namespace veneer::cli {
namespace {

constexpr double kDeadline_ms = 10;
constexpr double kSettle_s = 2;
constexpr std::size_t kRungs = 3;

/// One frame a second, on these rungs, each of so many ms.
std::vector<GovernedFrame> frames_on(const std::vector<std::size_t>& rungs, double ms = 5) {
  std::vector<GovernedFrame> frames;
  for (const std::size_t rung : rungs)
    frames.push_back({static_cast<double>(frames.size()), rung, false, ms});
  return frames;
}

PhaseFigures figures(const std::vector<GovernedFrame>& frames) {
  return figures_of(
      frames, {0, static_cast<double>(frames.size())}, kDeadline_ms, kRungs, kSettle_s);
}

TEST(GovernedDrive, FramesAreSteadyLongEnoughAfterStepsAndChangesOfLoad) {
  auto frames = frames_on({0, 0, 0, 0, 1, 1, 1, 1, 1, 1});
  // Late frames right after the load came and right after the step do not count as steady.
  frames[1].ms = frames[4].ms = frames[5].ms = 20;
  PhaseFigures f = figures(frames);
  EXPECT_EQ(f.steady_frames, 6U);  // seconds 2, 3 and 6 to 9
  EXPECT_DOUBLE_EQ(f.inside_steady.value(), 1.0);
  EXPECT_DOUBLE_EQ(f.inside.value(), 0.7);
  frames[8].ms = 20;
  f = figures(frames);
  EXPECT_DOUBLE_EQ(f.inside_steady.value(), 5.0 / 6);
  EXPECT_EQ(f.steps, 1U);
  EXPECT_DOUBLE_EQ(f.steps_per_minute, 6.0);
  EXPECT_EQ(f.last_rung, 1U);
}

TEST(GovernedDrive, ADeadlineIsKeptByAFrameThatTakesJustAsLong) {
  EXPECT_DOUBLE_EQ(figures(frames_on({0, 0, 0, 0}, kDeadline_ms)).inside.value(), 1.0);
}

TEST(GovernedDrive, PhasesTogetherHaveAllFramesAndSteps) {
  const auto frames = frames_on({0, 0, 2, 2, 1, 1, 0, 0, 0});
  std::size_t count = 0;
  std::size_t steps = 0;
  for (const LoadPhase& phase : {LoadPhase{0, 2}, {2, 5}, {5, 9}}) {
    const PhaseFigures f = figures_of(frames, phase, kDeadline_ms, kRungs, kSettle_s);
    EXPECT_NEAR(std::accumulate(f.share_of_rung.begin(), f.share_of_rung.end(), 0.0), 1.0, 1e-12);
    count += f.frames;
    steps += f.steps;
  }
  EXPECT_EQ(count, frames.size());
  EXPECT_EQ(steps, figures(frames).steps);
  EXPECT_EQ(steps, 3U);
}

TEST(GovernedDrive, AFailedTrialReturnsOnceAndAnOscillationAgainAndAgain) {
  EXPECT_EQ(figures(frames_on({2, 1, 0})).returns, 0U);
  const PhaseFigures trial = figures(frames_on({2, 2, 1, 2, 2}));
  EXPECT_EQ(trial.returns, 1U);
  EXPECT_EQ(trial.longest_returns, 1U);
  const PhaseFigures oscillation = figures(frames_on({2, 1, 2, 1, 2}));
  EXPECT_EQ(oscillation.returns, 3U);
  EXPECT_EQ(oscillation.longest_returns, 3U);
}

TEST(GovernedDrive, NothingIsSaidOfWhatDidNotHappen) {
  const PhaseFigures none = figures_of({}, {0, 10}, kDeadline_ms, kRungs, kSettle_s);
  EXPECT_EQ(none.frames, 0U);
  EXPECT_FALSE(none.inside);
  EXPECT_FALSE(none.inside_steady);
  EXPECT_FALSE(least_between_steps({}));
  EXPECT_FALSE(least_between_steps(frames_on({0, 0, 1, 1})));
  EXPECT_FALSE(seconds_to(0, frames_on({1, 1, 2}), {0, 3}));
  // A phase of no length has no rate.
  EXPECT_EQ(figures_of(frames_on({0, 1}), {1, 1}, kDeadline_ms, kRungs, kSettle_s).steps_per_minute,
            0.0);
}

TEST(GovernedDrive, TheLeastTimeBetweenStepsIsThatOfTheNearestTwo) {
  EXPECT_DOUBLE_EQ(least_between_steps(frames_on({0, 1, 1, 1, 0, 0, 2})).value(), 2.0);
}

TEST(GovernedDrive, ARungIsReachedWhenItsFadeIsOver) {
  auto frames = frames_on({2, 2, 2, 1, 1, 1});
  frames[3].fading = true;
  EXPECT_DOUBLE_EQ(seconds_to(1, frames, {1, 6}).value(), 3.0);
  EXPECT_DOUBLE_EQ(seconds_to(2, frames, {1, 6}).value(), 0.0) << "one that is better will do";
}

}  // namespace
}  // namespace veneer::cli
