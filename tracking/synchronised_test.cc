// SPDX-License-Identifier: Apache-2.0
#include "tracking/synchronised.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "base/units.h"

namespace veneer::tracking {
namespace {

using Eigen::Vector3d;

constexpr double kNoise_m = 2e-4;

Eigen::Quaterniond about_y(double angle_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Vector3d::UnitY()));
}

PoseHistory seen(const std::function<RigidTransform(double)>& motion,
                 double rate_hz,
                 std::uint64_t seed,
                 double seconds = 10) {
  Pcg32 random(seed);
  PoseHistory history;
  for (int i = 0; i < seconds * rate_hz; ++i) {
    PoseSample sample;
    sample.time = Time{from_seconds(i / rate_hz)};
    sample.world_from_body = motion(i / rate_hz);
    sample.world_from_body.translation +=
        kNoise_m * Vector3d(random.normal(), random.normal(), random.normal());
    history.add(sample);
  }
  return history;
}

/// At rest but from 3 s to 4 s and from 6 s to 6.5 s, when it goes on by 0.3 m.
RigidTransform stop_and_go(double t) {
  const auto step = [&](double from, double to) {
    const double done = std::clamp((t - from) / (to - from), 0.0, 1.0);
    return 0.5 - 0.5 * std::cos(std::numbers::pi * done);
  };
  return {about_y(0.4), Vector3d(0.3 * step(3, 4) + 0.3 * step(6, 6.5), 1, 2)};
}

RigidTransform at_rest(double) { return {about_y(-1), {5, 5, 5}}; }

RigidTransform moving(double t) { return {about_y(0.5 * t), {0.4 * t, 0, -0.2 * t}}; }

TEST(Synchronised, PosesOfOneMomentAreThoseOfThatMoment) {
  const std::vector<PoseHistory> histories{seen(moving, 240, 1), seen(at_rest, 100, 2)};
  std::vector<Time> moments;
  for (double t = 0.5; t < 9; t += 0.0931) moments.emplace_back(from_seconds(t));
  const auto samples = samples_at(histories, moments, {.half_width_s = 0.05});
  ASSERT_EQ(samples.size(), moments.size());
  double squares = 0;
  double claimed = 0;
  for (const SynchronisedSample& sample : samples) {
    const RigidTransform truth = moving(to_seconds(sample.time.time_since_epoch()));
    ASSERT_EQ(sample.poses.size(), 2U);
    const SynchronisedPose& pose = sample.poses[0];
    squares += (pose.world_from_body.translation - truth.translation).squaredNorm() / 3;
    claimed += pose.position_deviation_m * pose.position_deviation_m;
    EXPECT_LT(pose.world_from_body.rotation.angularDistance(truth.rotation), 1e-3);
    EXPECT_LT((sample.poses[1].world_from_body.translation - at_rest(0).translation).norm(),
              5 * kNoise_m);
  }
  // Some 90 moments, neighbours independent: known to 5 %.
  EXPECT_NEAR(std::sqrt(claimed / squares), 1, 0.2);
}

TEST(Synchronised, MomentsAtWhichOneIsUnknownAreLeftOut) {
  const std::vector<PoseHistory> histories{seen(moving, 240, 1), seen(at_rest, 240, 2, 5)};
  const std::vector<Time> moments{
      Time{from_seconds(-1)}, Time{from_seconds(4)}, Time{from_seconds(6)}};
  const auto samples = samples_at(histories, moments, {});
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].time, moments[1]);
}

TEST(Synchronised, EverySpanAtRestIsFoundOnce) {
  const std::vector<PoseHistory> histories{seen(stop_and_go, 240, 1), seen(at_rest, 120, 2)};
  const auto samples = still_samples(histories, {});
  ASSERT_EQ(samples.size(), 3U);
  const std::array<double, 3> from{0, 4, 6.5};
  const std::array<double, 3> to{3, 6, 10};
  for (std::size_t i = 0; i < 3; ++i) {
    // Its ends are unsure by the half width and by how slowly the motion begins.
    EXPECT_NEAR(to_seconds(samples[i].time.time_since_epoch()), (from[i] + to[i]) / 2, 0.05);
    EXPECT_NEAR(to_seconds(samples[i].span), to[i] - from[i], 0.1);
    const SynchronisedPose& pose = samples[i].poses[0];
    const RigidTransform truth = stop_and_go((from[i] + to[i]) / 2);
    EXPECT_LT((pose.world_from_body.translation - truth.translation).norm(), 0.1e-3);
    EXPECT_LT(pose.world_from_body.rotation.angularDistance(truth.rotation), 1e-6);
    // 0.2 mm over the root of 500 samples or more; four degrees of freedom tell it within 3 times.
    EXPECT_LT(pose.position_deviation_m, 3 * kNoise_m / std::sqrt(480));
    EXPECT_GT(pose.position_deviation_m, kNoise_m / std::sqrt(840) / 3);
    EXPECT_NEAR(pose.samples, 240 * (to[i] - from[i]), 30);
  }
}

TEST(Synchronised, OneThatMovesSpoilsTheRestOfAll) {
  const std::vector<PoseHistory> histories{seen(stop_and_go, 240, 1), seen(moving, 240, 2)};
  EXPECT_TRUE(still_samples(histories, {}).empty());
  const std::vector<PoseHistory> turning{seen(
      [](double t) {
        return RigidTransform{about_y(0.1 * t), {0, 0, 0}};
      },
      240,
      1)};
  EXPECT_TRUE(still_samples(turning, {}).empty()) << "6 degrees a second";
  EXPECT_TRUE(still_samples({}, {}).empty());
  EXPECT_TRUE(still_samples(std::vector<PoseHistory>(2), {}).empty());
}

TEST(Synchronised, DriftIsPartOfTheDeviation) {
  const std::vector<PoseHistory> histories{seen(
      [](double t) {
        return RigidTransform{about_y(0), {0.005 * t, 0, 0}};
      },
      240,
      1)};
  const auto samples = still_samples(histories, {});
  ASSERT_EQ(samples.size(), 1U);
  // Means of five parts, 1 cm apart: their deviation is 1.6 cm, over the root of 5 and of the three
  // coordinates.
  EXPECT_NEAR(samples[0].poses[0].position_deviation_m, 0.0158 / std::sqrt(15), 1e-4);
}

TEST(Synchronised, OptionsOutOfRangeAreRefused) {
  EXPECT_TRUE(SynchronisedOptions{}.check());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(SynchronisedOptions{.half_width_s = 0}.check());
  EXPECT_FALSE(SynchronisedOptions{.half_width_s = 1}.check());
  EXPECT_FALSE(SynchronisedOptions{.speed_half_width_s = 1}.check());
  EXPECT_FALSE(SynchronisedOptions{.still_m_s = kNan}.check());
  EXPECT_FALSE(SynchronisedOptions{.least_still_s = -1}.check());
}

}  // namespace
}  // namespace veneer::tracking
