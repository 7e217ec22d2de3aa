// SPDX-License-Identifier: Apache-2.0
// How far from the truth predictions are, on motions like those of a head.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "tracking/drivers/simulated/pose_noise.h"
#include "tracking/pose_track.h"

namespace veneer::tracking {
namespace {

struct Errors {
  double position_mm = 0;
  double rotation_deg = 0;
};

/// Root mean square of the errors of predictions `ahead_s` past the newest of noisy samples, on a
/// sine of 0.1 m and 0.5 m/s at its peak, turning at 1 rad/s.
Errors errors_of(double rate_hz, double ahead_s, const PoseNoise& noise) {
  const auto truth = [](double t) {
    RigidTransform pose;
    pose.translation = {0.1 * std::sin(5 * t), 0.3, 1.5};
    pose.rotation = Eigen::AngleAxisd(t, Eigen::Vector3d(1, 2, 2) / 3);
    return pose;
  };
  PoseTrack track{{}};
  Pcg32 random(8);
  double position = 0;
  double rotation = 0;
  const int count = static_cast<int>(20 * rate_hz);
  for (int i = 0; i < count; ++i) {
    const double t = i / rate_hz;
    PoseSample sample;
    sample.sequence = static_cast<std::uint64_t>(i);
    sample.time = Time{from_seconds(t)};
    sample.world_from_body = noise.added_to(truth(t), random);
    EXPECT_EQ(track.add(sample), PoseTrack::Verdict::kTaken);
    if (i < 10) continue;
    const RigidTransform predicted = track.at(sample.time + from_seconds(ahead_s)).world_from_body;
    const RigidTransform right = truth(t + ahead_s);
    position += (predicted.translation - right.translation).squaredNorm() / (count - 10);
    const double angle = predicted.rotation.angularDistance(right.rotation);
    rotation += angle * angle / (count - 10);
  }
  return {1e3 * std::sqrt(position), std::sqrt(rotation) * 180 / std::numbers::pi};
}

TEST(Prediction, StaysUnderAMillimetreAndATenthOfADegree) {
  const Errors errors = errors_of(120, 0.02, {.position_mm = 0.1, .rotation_deg = 0.02});
  EXPECT_LT(errors.position_mm, 1);
  EXPECT_LT(errors.rotation_deg, 0.1);
  RecordProperty("position_um", static_cast<int>(1e3 * errors.position_mm));
  RecordProperty("rotation_mdeg", static_cast<int>(1e3 * errors.rotation_deg));
}

TEST(Prediction, HoldsForOtherTrackersToo) {
  for (const double rate_hz : {60.0, 240.0, 400.0}) {
    const Errors errors = errors_of(rate_hz, 0.02, {.position_mm = 0.1, .rotation_deg = 0.02});
    EXPECT_LT(errors.position_mm, 1.1) << rate_hz;
    EXPECT_LT(errors.rotation_deg, 0.1) << rate_hz;
  }
}

}  // namespace
}  // namespace veneer::tracking
