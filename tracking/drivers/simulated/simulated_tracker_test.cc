// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated/simulated_tracker.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tracking/pose_track.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;

const std::string kOrbit =
    "[[path]]\nbody = 4\nkind = \"orbit\"\nradius_m = 0.5\nheight_m = 0.1\n"
    "from_deg = 0\nrate_deg_s = 57.29578\n";

Result<std::unique_ptr<SimulatedTracker>> tracker_of(const std::string& text, Clock& clock) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "test"));
  VENEER_ASSIGN(std::unique_ptr<SimulatedTracker> tracker, SimulatedTracker::open(toml, clock));
  VENEER_TRY(toml.finish());
  return tracker;
}

std::vector<PoseSample> take(SimulatedTracker& tracker, int count) {
  std::vector<PoseSample> samples;
  for (int i = 0; i < count; ++i) samples.push_back(tracker.wait_pose(milliseconds(100)).value());
  return samples;
}

double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return 2 * std::asin(std::min(1.0, (a.conjugate() * b).vec().norm()));
}

TEST(SimulatedTracker, MeasuresTheTruthOnItsOwnGrid) {
  VirtualClock clock(Time{Duration{12345}});
  auto tracker = tracker_of("rate_hz = 300\n" + kOrbit, clock);
  ASSERT_TRUE(tracker) << tracker.error().what;
  EXPECT_EQ((*tracker)->start(), Time{Duration{12345}});
  const std::vector<PoseSample> samples = take(**tracker, 901);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const PoseSample& sample = samples[i];
    EXPECT_EQ(sample.body, 4);
    EXPECT_EQ(sample.sequence, i);
    const auto truth = (*tracker)->true_pose(4, sample.time);
    ASSERT_TRUE(truth);
    EXPECT_EQ(sample.world_from_body.translation, truth->translation);
    EXPECT_EQ(sample.world_from_body.rotation.coeffs(), truth->rotation.coeffs());
  }
  EXPECT_EQ(samples.back().time - samples.front().time, std::chrono::seconds(3));  // no drift
  EXPECT_FALSE((*tracker)->true_pose(5, clock.now()));
}

TEST(SimulatedTracker, SamplesArriveAfterTheLatency) {
  VirtualClock clock;
  auto tracker = tracker_of("rate_hz = 100\nlatency_ms = 25\n" + kOrbit, clock);
  ASSERT_TRUE(tracker);
  for (int i = 0; i < 10; ++i) {
    const auto sample = (*tracker)->wait_pose(milliseconds(100));
    ASSERT_TRUE(sample);
    EXPECT_EQ(clock.now() - sample->time, milliseconds(25));
  }
}

TEST(SimulatedTracker, TimesOutAtTheRightMomentAndThenGoesOn) {
  VirtualClock clock;
  auto tracker = tracker_of("rate_hz = 10\n" + kOrbit, clock);
  ASSERT_TRUE(tracker);
  ASSERT_TRUE((*tracker)->wait_pose(milliseconds(0)));  // the first is there at once
  const auto early = (*tracker)->wait_pose(milliseconds(30));
  ASSERT_FALSE(early);
  EXPECT_EQ(early.error().code, Errc::kTimeout);
  EXPECT_EQ(clock.now(), Time{milliseconds(30)});
  const auto second = (*tracker)->wait_pose(Duration::max());
  ASSERT_TRUE(second);
  EXPECT_EQ(second->sequence, 1U);
  EXPECT_EQ(clock.now(), Time{milliseconds(100)});
}

TEST(SimulatedTracker, QueuesWhatNobodyFetched) {
  VirtualClock clock;
  auto tracker = tracker_of("rate_hz = 100\n" + kOrbit, clock);
  ASSERT_TRUE(tracker);
  clock.sleep_until(Time{milliseconds(55)});
  for (std::uint64_t i = 0; i < 6; ++i) {
    const auto sample = (*tracker)->wait_pose(milliseconds(0));
    ASSERT_TRUE(sample) << i;
    EXPECT_EQ(sample->sequence, i);
  }
  EXPECT_FALSE((*tracker)->wait_pose(milliseconds(0)));
  EXPECT_EQ(clock.now(), Time{milliseconds(55)});
}

TEST(SimulatedTracker, SendsEveryBodyAtEveryTick) {
  VirtualClock clock;
  auto tracker = tracker_of(
      "[[path]]\nbody = 2\nkind = \"fixed\"\n[[path]]\nbody = 1\nkind = \"fixed\"\n", clock);
  ASSERT_TRUE(tracker);
  const std::vector<PoseSample> samples = take(**tracker, 6);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(samples[i].body, i % 2 == 0 ? 2 : 1);
    EXPECT_EQ(samples[i].sequence, i / 2);
    EXPECT_EQ(samples[i].time, samples[i - i % 2].time);
  }
}

TEST(SimulatedTracker, NoiseHasTheSizeAskedForAndFollowsTheSeed) {
  const auto run = [](int seed) {
    VirtualClock clock;
    auto tracker = tracker_of(
        fmt::format(
            "noise_position_mm = 0.5\nnoise_rotation_deg = 0.2\nseed = {}\n{}", seed, kOrbit),
        clock);
    std::vector<PoseSample> samples = take(**tracker, 4000);
    double position_sum = 0;
    double rotation_sum = 0;
    for (const PoseSample& sample : samples) {
      const RigidTransform truth = *(*tracker)->true_pose(4, sample.time);
      position_sum += (sample.world_from_body.translation - truth.translation).squaredNorm();
      rotation_sum += std::pow(angle_between(sample.world_from_body.rotation, truth.rotation), 2);
    }
    // 12000 components: the deviation of their root mean square is 0.65 %; four times that.
    EXPECT_NEAR(std::sqrt(position_sum / 12000), 0.5e-3, 0.026 * 0.5e-3) << seed;
    const double sigma_rad = 0.2 * std::numbers::pi / 180;
    EXPECT_NEAR(std::sqrt(rotation_sum / 12000), sigma_rad, 0.026 * sigma_rad) << seed;
    return samples;
  };
  const std::vector<PoseSample> first = run(1);
  const std::vector<PoseSample> again = run(1);
  const std::vector<PoseSample> other = run(2);
  EXPECT_EQ(first.back().world_from_body.translation, again.back().world_from_body.translation);
  EXPECT_NE(first.back().world_from_body.translation, other.back().world_from_body.translation);
}

TEST(SimulatedTracker, ItsSamplesPredictTheTruth) {
  VirtualClock clock;
  auto tracker = tracker_of(kOrbit, clock);  // 0.5 m/s, 1 rad/s
  ASSERT_TRUE(tracker);
  PoseTrack track{{}};
  double worst_m = 0;
  double worst_rad = 0;
  for (int i = 0; i < 240; ++i) {
    const PoseSample sample = (*tracker)->wait_pose(milliseconds(100)).value();
    track.add(sample);
    if (i < 10) continue;
    const Time when = sample.time + milliseconds(20);
    const RigidTransform predicted = track.at(when).world_from_body;
    const RigidTransform truth = *(*tracker)->true_pose(4, when);
    worst_m = std::max(worst_m, (predicted.translation - truth.translation).norm());
    worst_rad = std::max(worst_rad, angle_between(predicted.rotation, truth.rotation));
  }
  EXPECT_LT(worst_m, 1e-3);
  EXPECT_LT(worst_rad, 0.1 * std::numbers::pi / 180);
  RecordProperty("worst_um", static_cast<int>(worst_m * 1e6));
}

TEST(SimulatedTracker, RefusesBadOptions) {
  VirtualClock clock;
  for (const std::string& text : {std::string(),
                                  "rate_hz = 0\n" + kOrbit,
                                  "rate_hz = 1e9\n" + kOrbit,
                                  "noise_position_mm = -1\n" + kOrbit,
                                  "noise_rotation_deg = 91\n" + kOrbit,
                                  "latency_ms = -1\n" + kOrbit,
                                  kOrbit + kOrbit,
                                  "rate = 240\n" + kOrbit,
                                  std::string("path = 3\n")}) {
    const auto tracker = tracker_of(text, clock);
    ASSERT_FALSE(tracker) << text;
    EXPECT_EQ(tracker.error().code, Errc::kInvalidOption) << text;
  }
}

}  // namespace
}  // namespace veneer::tracking
