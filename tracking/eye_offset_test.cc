// SPDX-License-Identifier: Apache-2.0
#include "tracking/eye_offset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "base/random.h"
#include "base/units.h"

namespace veneer::tracking {
namespace {

using Eigen::Vector3d;

const Vector3d kEyeInSensor(0.012, 0.081, 0.064);
const Vector3d kEyeInWorld(0.4, -1.2, 2.5);

/// A head that turns about its eye, seen by a tracker of 240 Hz.
struct Head {
  Vector3d swing_deg{8, 15, 6};  ///< how far it turns to either side about x, y and z
  double position_mm = 0;        ///< noise of the tracker
  double rotation_deg = 0;
  double wander_mm = 0;  ///< of the eye, slowly
  double outliers = 0;   ///< part of the samples that are half a metre off
  double seconds = 20;

  [[nodiscard]] PoseHistory seen(std::uint64_t seed = 1) const {
    Pcg32 random(seed);
    const auto normals = [&] {
      return Vector3d(random.normal(), random.normal(), random.normal());
    };
    const auto turn = [](const Vector3d& degrees) {
      const Vector3d vector = to_radians(Degrees{1}).value * degrees;
      const double angle = vector.norm();
      return Eigen::Quaterniond(
          Eigen::AngleAxisd(angle, angle > 0 ? Vector3d(vector / angle) : Vector3d::UnitX()));
    };
    const Eigen::Quaterniond straight(0.3, -0.5, 0.7, 0.4);
    PoseHistory history;
    for (int i = 0; i < 240 * seconds; ++i) {
      const double t = i / 240.0;
      const Vector3d phase(std::sin(2.1 * t), std::sin(1.3 * t + 1), std::sin(3.4 * t + 2));
      const Vector3d eye =
          kEyeInWorld +
          1e-3 * wander_mm * Vector3d(std::sin(0.7 * t), std::cos(0.9 * t), std::sin(1.1 * t));
      PoseSample sample;
      sample.time = Time{from_seconds(t)};
      const Eigen::Quaterniond rotation =
          straight.normalized() * turn(swing_deg.cwiseProduct(phase));
      sample.world_from_body.translation =
          eye - rotation * kEyeInSensor + 1e-3 * position_mm * normals();
      sample.world_from_body.rotation = rotation * turn(rotation_deg * normals());
      if (random.uniform() < outliers) sample.world_from_body.translation += 0.5 * normals();
      EXPECT_TRUE(history.add(sample));
    }
    return history;
  }
};

double error_m(const EyeOffset& offset) { return (offset.eye_in_sensor - kEyeInSensor).norm(); }

TEST(EyeOffset, IsExactWithoutNoise) {
  const auto offset = measure_eye_offset(Head{}.seen());
  ASSERT_TRUE(offset) << offset.error().what;
  EXPECT_LT(error_m(*offset), 1e-9);
  EXPECT_LT((offset->eye_in_world - kEyeInWorld).norm(), 1e-9);
  EXPECT_LT(offset->residual_m, 1e-9);
  EXPECT_EQ(offset->outliers, 0U);
  EXPECT_TRUE(check(*offset, {}));
}

TEST(EyeOffset, SpansAreThoseOfTheTurning) {
  const auto offset = measure_eye_offset(Head{}.seen());
  ASSERT_TRUE(offset);
  // 15, 8 and 6 degrees to either side; in 20 s the swings are not quite unrelated, and the axes
  // of most and least turning a little off y, x and z.
  EXPECT_NEAR(offset->span_deg[0], 30, 3);
  EXPECT_NEAR(offset->span_deg[1], 16, 1.6);
  EXPECT_NEAR(offset->span_deg[2], 12, 1.2);
}

TEST(EyeOffset, NoiseOfTheTrackerHardlyMatters) {
  const Head head{.position_mm = 0.2, .rotation_deg = 0.02};
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto offset = measure_eye_offset(head.seen(seed));
    ASSERT_TRUE(offset);
    // 0.2 mm a coordinate over the square root of 4800 samples and some 0.1 rad of turning is
    // 0.03 mm; five times that.
    EXPECT_LT(error_m(*offset), 0.15e-3);
    EXPECT_LT(offset->deviation_m(), 0.15e-3);
    EXPECT_NEAR(offset->residual_m, 0.2e-3 * std::sqrt(3), 0.03e-3);
    EXPECT_GE(offset->held_out_m, offset->residual_m);
    EXPECT_TRUE(check(*offset, {}));
  }
}

TEST(EyeOffset, TheDeviationCountsThatTheEyeWanders) {
  const auto offset = measure_eye_offset(
      Head{.position_mm = 0.2, .rotation_deg = 0.02, .wander_mm = 1, .seconds = 60}.seen());
  ASSERT_TRUE(offset);
  EXPECT_LT(error_m(*offset), 3 * offset->deviation_m());
  EXPECT_GT(offset->deviation_m(), 0.1e-3) << "independent noise would give a tenth of it";
}

TEST(EyeOffset, OutliersAreLeftOut) {
  const Head head{.position_mm = 0.2, .rotation_deg = 0.02, .outliers = 0.2};
  const auto offset = measure_eye_offset(head.seen());
  ASSERT_TRUE(offset);
  EXPECT_LT(error_m(*offset), 0.15e-3) << "as without them";
  EXPECT_NEAR(static_cast<double>(offset->outliers), 0.2 * 4800, 100);
  EXPECT_TRUE(check(*offset, {}));
}

/// Whether the measurement is refused for what the words say.
testing::AssertionResult refused(const Result<EyeOffset>& offset, const std::string& words) {
  if (!offset) return testing::AssertionFailure() << offset.error().what;
  const Status status = check(*offset, {});
  if (status) return testing::AssertionFailure() << "accepted, error " << error_m(*offset);
  if (status.error().what.find(words) == std::string::npos)
    return testing::AssertionFailure() << status.error().what;
  return testing::AssertionSuccess();
}

TEST(EyeOffset, OneAxisIsNotEnough) {
  const auto offset = measure_eye_offset(
      Head{.swing_deg = {0, 40, 0}, .position_mm = 0.2, .rotation_deg = 0.02}.seen());
  EXPECT_TRUE(refused(offset, "about a second"));
  EXPECT_NEAR(offset->span_deg[0], 80, 1);
  EXPECT_LT(offset->span_deg[1], 0.2);
  // Across the axis it is known all the same.
  EXPECT_NEAR(offset->eye_in_sensor.x(), kEyeInSensor.x(), 1e-4);
  EXPECT_NEAR(offset->eye_in_sensor.z(), kEyeInSensor.z(), 1e-4);
}

TEST(EyeOffset, TwoAxesAre) {
  const auto offset = measure_eye_offset(
      Head{.swing_deg = {8, 8, 0}, .position_mm = 0.2, .rotation_deg = 0.02}.seen());
  ASSERT_TRUE(offset);
  EXPECT_TRUE(check(*offset, {}));
  EXPECT_LT(error_m(*offset), 0.3e-3);
}

TEST(EyeOffset, AHeadAtRestIsRefused) {
  const auto still = measure_eye_offset(Head{.swing_deg = {0, 0, 0}}.seen());
  EXPECT_TRUE(refused(still, "0.0 degrees about one axis"));
  EXPECT_TRUE(still->eye_in_sensor.allFinite());
  EXPECT_TRUE(still->covariance.allFinite());
  EXPECT_TRUE(refused(measure_eye_offset(Head{.swing_deg = {2, 3, 1}}.seen()), "nod"));
}

TEST(EyeOffset, AnEyeThatDoesNotStayIsRefused) {
  EXPECT_TRUE(refused(measure_eye_offset(Head{.wander_mm = 10}.seen()), "keep it there"));
  EXPECT_TRUE(refused(measure_eye_offset(Head{.outliers = 0.45}.seen()), "do not fit"));
}

TEST(EyeOffset, TooFewPosesAreAnError) {
  const auto offset = measure_eye_offset(Head{.seconds = 0.2}.seen());
  ASSERT_FALSE(offset);
  EXPECT_EQ(offset.error().code, Errc::kBadFormat);
  EXPECT_FALSE(measure_eye_offset(PoseHistory()));
}

}  // namespace
}  // namespace veneer::tracking
