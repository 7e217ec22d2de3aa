// SPDX-License-Identifier: Apache-2.0
#include "tracking/pose_history.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/random.h"
#include "base/testing/temporary_folder.h"
#include "tracking/recording.h"

namespace veneer::tracking {
namespace {

using Eigen::Vector3d;
using namespace std::chrono_literals;

PoseSample sample_at(double time_s, const Vector3d& position, double angle_rad = 0) {
  PoseSample sample;
  sample.time = Time{from_seconds(time_s)};
  sample.world_from_body = {Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Vector3d::UnitY())),
                            position};
  return sample;
}

TEST(PoseHistory, DropsWhatIsNoPoseOrNotLater) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  PoseHistory history;
  EXPECT_TRUE(history.add(sample_at(1, {0, 0, 0})));
  EXPECT_FALSE(history.add(sample_at(2, {0, kNan, 0})));
  EXPECT_FALSE(history.add(sample_at(2, {0, 0, 1 / 0.0})));
  PoseSample bad = sample_at(2, {0, 0, 0});
  bad.world_from_body.rotation.coeffs().setZero();
  EXPECT_FALSE(history.add(bad));
  bad.world_from_body.rotation.coeffs().setConstant(kNan);
  EXPECT_FALSE(history.add(bad));
  EXPECT_FALSE(history.add(sample_at(1, {0, 0, 0})));
  EXPECT_FALSE(history.add(sample_at(0.5, {0, 0, 0})));
  EXPECT_EQ(history.samples().size(), 1U);
  EXPECT_EQ(history.dropped(), 6U);
}

TEST(PoseHistory, RotationsStayOnOneSide) {
  PoseHistory history;
  for (int i = 0; i < 100; ++i) {
    PoseSample sample = sample_at(0.01 * i, Vector3d::Zero(), 0.1 * i);
    if (i % 3 == 0) sample.world_from_body.rotation.coeffs() *= -1.05;
    ASSERT_TRUE(history.add(sample));
  }
  for (std::size_t i = 1; i < 100; ++i) {
    const Eigen::Quaterniond& q = history.samples()[i].world_from_body.rotation;
    EXPECT_NEAR(q.norm(), 1, 1e-12);
    EXPECT_GT(q.dot(history.samples()[i - 1].world_from_body.rotation), 0);
  }
}

TEST(PoseHistory, AStraightMotionIsFittedExactlyWhereverTheMomentLies) {
  const Vector3d start(1000, -2, 3);  // far out, where squares lose digits
  const Vector3d velocity(0.3, -0.4, 1.2);
  PoseHistory history;
  double time_s = 0;
  Pcg32 random(3);
  for (int i = 0; i < 400; ++i, time_s += 0.002 + 0.004 * random.uniform())
    history.add(sample_at(time_s, start + time_s * velocity, 1e-3 * time_s));
  for (double t = 0.1; t < 1; t += 0.0137) {
    const auto fit = history.fit_at(Time{from_seconds(t)}, 20ms);
    ASSERT_TRUE(fit);
    EXPECT_LT((fit->position - start - t * velocity).norm(), 1e-8);
    EXPECT_NEAR(fit->speed_m_s, velocity.norm(), 1e-6);
    EXPECT_NEAR(fit->turning_rad_s, 1e-3, 1e-6);
    EXPECT_LT(fit->position_spread_m, 1e-8);
  }
}

TEST(PoseHistory, KnowsHowUnsureItIs) {
  constexpr double kNoise_m = 2e-4;
  Pcg32 random(7);
  PoseHistory history;
  for (int i = 0; i < 24000; ++i) {
    const Vector3d noise(random.normal(), random.normal(), random.normal());
    history.add(sample_at(i / 240.0, kNoise_m * noise));
  }
  double spread = 0;
  double claimed = 0;
  double squares = 0;
  int count = 0;
  for (double t = 0.05; t < 99.9; t += 0.05, ++count) {
    const auto fit = history.fit_at(Time{from_seconds(t)}, 25ms);
    ASSERT_TRUE(fit);
    spread += fit->position_spread_m;
    claimed += fit->position_spread_m * fit->gain;
    squares += fit->position.squaredNorm() / 3;
  }
  // 2000 windows of 12 samples: the means are known to about 1 %; a deviation estimated from ten
  // degrees of freedom is low by 2.5 %, and more for unequal weights.
  EXPECT_NEAR(spread / count, kNoise_m, 0.1 * kNoise_m);
  EXPECT_NEAR(claimed / count / std::sqrt(squares / count), 1, 0.12);
}

TEST(PoseHistory, DampsNoiseAlikeWhereverTheMomentLies) {
  PoseHistory history;
  for (int i = 0; i < 240; ++i) history.add(sample_at(i / 240.0, Vector3d::Zero()));
  double low = 1;
  double high = 0;
  for (double phase = 0; phase < 1; phase += 0.1) {
    const auto fit = history.fit_at(Time{from_seconds((100 + phase) / 240)}, 25ms);
    ASSERT_TRUE(fit);
    low = std::min(low, fit->gain);
    high = std::max(high, fit->gain);
  }
  // Equal weights, of which eleven or twelve samples get one, differ by 4 %.
  EXPECT_LT(high / low, 1.01);
}

TEST(PoseHistory, DoesNotReachOverGapsEndsOrEpochs) {
  PoseHistory history;
  for (int i = 0; i < 100; ++i) {
    PoseSample sample = sample_at(0.01 * i + (i >= 50 ? 1.0 : 0.0), Vector3d::Zero());
    sample.epoch = i < 25 ? 0 : 1;
    history.add(sample);
  }
  EXPECT_TRUE(history.fit_at(Time{100ms}, 25ms));
  EXPECT_FALSE(history.fit_at(Time{246ms}, 25ms)) << "two epochs";
  EXPECT_FALSE(history.fit_at(Time{-1ms}, 50ms)) << "before all";
  EXPECT_FALSE(history.fit_at(Time{1000ms}, 25ms)) << "in the gap";
  EXPECT_FALSE(history.fit_at(Time{500ms}, 100ms)) << "past the last one before the gap";
  EXPECT_FALSE(history.fit_at(Time{100ms}, 11ms)) << "three samples";
  EXPECT_FALSE(PoseHistory().fit_at(Time{}, 1s));
}

TEST(PoseHistory, IsReadFromARecording) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "poses.jsonl";
  auto recorder = PoseRecorder::create(path);
  ASSERT_TRUE(recorder);
  for (int i = 0; i < 6; ++i) {
    PoseSample sample = sample_at(i, Vector3d::Zero());
    sample.body = i % 2 == 0 ? 3 : 8;
    ASSERT_TRUE(recorder->write(sample));
  }
  const auto history = read_history(path, 8);
  ASSERT_TRUE(history) << history.error().what;
  EXPECT_EQ(history->samples().size(), 3U);
  const auto absent = read_history(path, 1);
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, Errc::kNotFound);
  EXPECT_NE(absent.error().what.find("3, 8"), std::string::npos) << absent.error().what;
}

}  // namespace
}  // namespace veneer::tracking
