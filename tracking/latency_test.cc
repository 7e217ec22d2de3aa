// SPDX-License-Identifier: Apache-2.0
#include "tracking/latency.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "base/random.h"
#include "base/units.h"

namespace veneer::tracking {
namespace {

using Eigen::Vector3d;

Eigen::Quaterniond turn(const Vector3d& vector_rad) {
  const double angle = vector_rad.norm();
  return Eigen::Quaterniond(
      Eigen::AngleAxisd(angle, angle > 0 ? Vector3d(vector_rad / angle) : Vector3d::UnitX()));
}

using Motion = std::function<RigidTransform(double)>;

/// Somebody waves a thing about: no harmonic relation between the swings.
RigidTransform waving(double t) {
  return {turn({0.5 * std::sin(2.7 * t), 0.4 * std::sin(4.1 * t + 1), 0.6 * std::sin(1.9 * t + 2)}),
          {0.15 * std::sin(3.3 * t), 0.1 * std::sin(2.1 * t + 1), 0.08 * std::sin(5.2 * t + 2)}};
}

struct Source {
  double rate_hz = 240;
  double latency_s = 0;  ///< that its stamps do not know of
  double position_mm = 0.2;
  double rotation_deg = 0.02;
  RigidTransform world{};  ///< its own world from that of the motion
  RigidTransform body{};   ///< the thing from its own body
  double phase = 0;        ///< of its sampling, in samples
  double seconds = 10;

  [[nodiscard]] PoseHistory seen(const Motion& motion, std::uint64_t seed) const {
    Pcg32 random(seed);
    const auto normals = [&] {
      return Vector3d(random.normal(), random.normal(), random.normal());
    };
    PoseHistory history;
    for (int i = 0; i < seconds * rate_hz; ++i) {
      const double t = (i + phase) / rate_hz;
      PoseSample sample;
      sample.time = Time{from_seconds(100 + t)};
      sample.world_from_body = world * motion(t - latency_s) * body;
      sample.world_from_body.translation += 1e-3 * position_mm * normals();
      const Vector3d tilt = to_radians(Degrees{rotation_deg}).value * normals();
      sample.world_from_body.rotation = sample.world_from_body.rotation * turn(tilt);
      EXPECT_TRUE(history.add(sample));
    }
    return history;
  }
};

const Source kReference{.rate_hz = 360, .phase = 0.3};

Result<Latency> measured(const Source& tracker,
                         const Source& reference,
                         const Motion& motion = waving,
                         std::uint64_t seed = 1) {
  return measure_latency(tracker.seen(motion, seed), reference.seen(motion, seed + 100), {});
}

TEST(MeasuredLatency, IsThatOfTheTracker) {
  // At 240 Hz with the noise of the demo.
  for (const double latency_ms : {0.0, 1.0, 3.7, 12.5, 40.0, 120.0, -8.0}) {
    const auto latency = measured({.latency_s = 1e-3 * latency_ms}, kReference);
    ASSERT_TRUE(latency) << latency.error().what;
    // 0.3 mm over 0.5 m/s and the square root of 2400 samples is 0.012 ms; five times that, and far
    // below the 0.5 ms that prediction cares about.
    EXPECT_NEAR(1e3 * latency->latency_s, latency_ms, 0.06);
    EXPECT_LT(latency->deviation_s, 0.06e-3);
    EXPECT_TRUE(check(*latency, {}));
  }
}

TEST(MeasuredLatency, DoesNotDependOnWhereSamplesFall) {
  // Interpolation between two samples would pull the result to half way between samples.
  double low = 1;
  double high = -1;
  for (int i = 0; i < 8; ++i) {
    const auto latency =
        measured({.latency_s = 0.01 + i / 8.0 / 240, .position_mm = 2, .rotation_deg = 0.2},
                 {.rate_hz = 240});
    ASSERT_TRUE(latency);
    low = std::min(low, latency->latency_s - (0.01 + i / 8.0 / 240));
    high = std::max(high, latency->latency_s - (0.01 + i / 8.0 / 240));
  }
  // Ten times the noise of the demo, and with it ten times its 0.03 ms.
  EXPECT_LT(high, 0.3e-3);
  EXPECT_GT(low, -0.3e-3);
}

TEST(MeasuredLatency, FramesNeedNotAgree) {
  const RigidTransform world{Eigen::Quaterniond(0.2, 0.7, -0.4, 0.5).normalized(), {10, -3, 2}};
  const RigidTransform body{Eigen::Quaterniond(0.9, -0.1, 0.3, 0.2).normalized(), {0, 0, 0}};
  const auto latency = measured({.latency_s = 0.02, .world = world, .body = body}, kReference);
  ASSERT_TRUE(latency);
  EXPECT_NEAR(latency->latency_s, 0.02, 0.06e-3);
  EXPECT_TRUE(check(*latency, {}));
}

TEST(MeasuredLatency, TwoPointsOfOneThingAreComparedByTheirTurning) {
  const RigidTransform body{Eigen::Quaterniond(0.9, -0.1, 0.3, 0.2).normalized(), {0.3, 0.1, 0}};
  const auto latency = measured({.latency_s = 0.02, .body = body}, kReference);
  ASSERT_TRUE(latency);
  EXPECT_EQ(latency->signal, MotionSignal::kRotation);
  EXPECT_NEAR(latency->latency_s, 0.02, 0.06e-3);
  EXPECT_TRUE(check(*latency, {}));
}

TEST(MeasuredLatency, AThingThatOnlyTurnsOrOnlyMovesWill) {
  const auto turning = measured({.latency_s = 0.02}, kReference, [](double t) {
    return RigidTransform{waving(t).rotation, Vector3d::Zero()};
  });
  ASSERT_TRUE(turning);
  EXPECT_EQ(turning->signal, MotionSignal::kRotation);
  EXPECT_NEAR(turning->latency_s, 0.02, 0.1e-3);
  EXPECT_TRUE(check(*turning, {}));
  const auto moving = measured({.latency_s = 0.02}, kReference, [](double t) {
    return RigidTransform{Eigen::Quaterniond::Identity(), waving(t).translation};
  });
  ASSERT_TRUE(moving);
  EXPECT_EQ(moving->signal, MotionSignal::kPosition);
  EXPECT_NEAR(moving->latency_s, 0.02, 0.1e-3);
  EXPECT_TRUE(check(*moving, {}));
}

TEST(MeasuredLatency, TheDeviationIsHonest) {
  double squares = 0;
  double claimed = 0;
  constexpr int kRuns = 12;
  for (std::uint64_t run = 0; run < kRuns; ++run) {
    const auto latency = measured({.latency_s = 0.013, .position_mm = 3, .rotation_deg = 0.5},
                                  {.seconds = 5},
                                  waving,
                                  7 * run);
    ASSERT_TRUE(latency);
    squares += std::pow(latency->latency_s - 0.013, 2) / kRuns;
    claimed += std::pow(latency->deviation_s, 2) / kRuns;
  }
  // Twelve runs tell a deviation to 20 %; ten parts no better. Three of these.
  EXPECT_GT(std::sqrt(claimed / squares), 0.5);
  EXPECT_LT(std::sqrt(claimed / squares), 2);
}

testing::AssertionResult refused(const Result<Latency>& latency, const std::string& words) {
  if (!latency) return testing::AssertionFailure() << latency.error().what;
  const Status status = check(*latency, {});
  if (status)
    return testing::AssertionFailure()
           << "accepted: " << latency->latency_s << " s +- " << latency->deviation_s;
  if (status.error().what.find(words) == std::string::npos)
    return testing::AssertionFailure() << status.error().what;
  return testing::AssertionSuccess();
}

TEST(MeasuredLatency, TooLittleMotionIsRefused) {
  EXPECT_TRUE(refused(measured({}, kReference, [](double) { return RigidTransform{}; }),
                      "move the thing fast"));
  EXPECT_TRUE(refused(measured({},
                               kReference,
                               [](double t) {
                                 const RigidTransform wave = waving(t);
                                 return RigidTransform{
                                     Eigen::Quaterniond::Identity().slerp(1e-4, wave.rotation),
                                     1e-3 * wave.translation};
                               }),
                      "move the thing fast"));
}

TEST(MeasuredLatency, WithoutNoiseItIsNotKnownBetter) {
  const Source exact{.position_mm = 0, .rotation_deg = 0};
  EXPECT_TRUE(refused(measured(exact, exact, [](double) { return RigidTransform{}; }),
                      "move the thing fast"));
  EXPECT_TRUE(refused(measured(exact,
                               exact,
                               [](double t) {
                                 const Eigen::Quaterniond turned = turn({0, 0, 2 * t});
                                 return RigidTransform{turned, turned * Vector3d(0.5, 0, 0)};
                               }),
                      "unevenly"));
}

TEST(MeasuredLatency, EvenTurningTellsNothing) {
  // A moment later it is the same but for a turn.
  EXPECT_TRUE(refused(measured({.latency_s = 0.02},
                               kReference,
                               [](double t) {
                                 const Eigen::Quaterniond turned = turn({0, 0, 2 * t});
                                 return RigidTransform{turned, turned * Vector3d(0.5, 0, 0)};
                               }),
                      "unevenly"));
}

TEST(MeasuredLatency, AMotionThatRepeatsItselfIsRefused) {
  // 8 Hz: every eighth of a second is as good, and every sixteenth, turned round.
  EXPECT_TRUE(
      refused(measured({.latency_s = 0.02},
                       kReference,
                       [](double t) {
                         const double swing = std::sin(16 * std::numbers::pi * t);
                         return RigidTransform{turn({0, 0, 0.1 * swing}), {0.02 * swing, 0, 0}};
                       }),
              "repeats itself"));
}

TEST(MeasuredLatency, AnotherMotionIsRefused) {
  const PoseHistory tracker = Source{}.seen(waving, 1);
  const PoseHistory other =
      kReference.seen([](double t) { return waving(1.37 * t + 55 + std::sin(0.3 * t)); }, 2);
  EXPECT_FALSE(check(measure_latency(tracker, other, {}).value(), {}));
  // The same one, farther off than is looked for.
  EXPECT_FALSE(check(measured({.latency_s = 0.3}, kReference).value(), {}));
}

TEST(MeasuredLatency, AMirrorImageIsAnotherMotion) {
  const Motion moving = [](double t) {
    return RigidTransform{Eigen::Quaterniond::Identity(), waving(t).translation};
  };
  const PoseHistory tracker = Source{}.seen(moving, 1);
  PoseHistory mirrored;
  for (PoseSample sample : tracker.samples()) {
    sample.world_from_body.translation.x() *= -1;
    mirrored.add(sample);
  }
  EXPECT_FALSE(check(measure_latency(mirrored, kReference.seen(moving, 2), {}).value(), {}));
}

TEST(MeasuredLatency, RecordingsOfDifferentTimesAreAnError) {
  const PoseHistory tracker = Source{}.seen(waving, 1);
  PoseHistory later;
  for (PoseSample sample : tracker.samples()) {
    sample.time += std::chrono::hours(1);
    later.add(sample);
  }
  const auto latency = measure_latency(tracker, later, {});
  ASSERT_FALSE(latency);
  EXPECT_EQ(latency.error().code, Errc::kBadFormat);
  EXPECT_FALSE(measure_latency(PoseHistory(), tracker, {}));
  EXPECT_FALSE(measure_latency(tracker, PoseHistory(), {}));
  EXPECT_FALSE(measure_latency(tracker, Source{.rate_hz = 30}.seen(waving, 1), {}));
  EXPECT_EQ(measure_latency(tracker, tracker, {.most_s = 0}).error().code, Errc::kInvalidOption);
  EXPECT_EQ(measure_latency(tracker, tracker, {.smoothing_s = -1}).error().code,
            Errc::kInvalidOption);
}

TEST(MeasuredLatency, ASlowTrackerNeedsMoreSmoothing) {
  const PoseHistory tracker = Source{.rate_hz = 30, .latency_s = 0.045}.seen(waving, 1);
  const auto latency = measure_latency(tracker, kReference.seen(waving, 2), {.smoothing_s = 0.08});
  ASSERT_TRUE(latency) << latency.error().what;
  // An eighth of the samples, under a shape that two rates of sampling weigh a little differently.
  EXPECT_NEAR(latency->latency_s, 0.045, 0.3e-3);
}

}  // namespace
}  // namespace veneer::tracking
