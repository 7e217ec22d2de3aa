// SPDX-License-Identifier: Apache-2.0
#include "tracking/pose_track.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <new>
#include <numbers>
#include <thread>
#include <vector>

#include "base/random.h"

namespace {
thread_local int allocations = 0;
}  // namespace

// Counts what this thread allocates. Weak, since sanitizers bring operators of their own; not
// inlined, lest the compiler sees malloc meet delete.
[[gnu::weak, gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::weak, gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::weak, gnu::noinline]] void operator delete(void* memory, std::size_t /*size*/) noexcept {
  std::free(memory);
}

namespace veneer::tracking {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kRate_hz = 240;
/// Differences of positions of a metre over 4 ms, fitted and carried ahead by 0.2 s.
constexpr double kRoundingTolerance = 1e-9;

Time at_seconds(double seconds) { return Time{Duration{std::llround(seconds * 1e9)}}; }

double angle_between(const Quaterniond& a, const Quaterniond& b) {
  return 2 * std::asin(std::min(1.0, (a.conjugate() * b).vec().norm()));
}

PoseSample sample_of(const RigidTransform& pose, double seconds, std::uint64_t sequence) {
  PoseSample sample;
  sample.time = at_seconds(seconds);
  sample.world_from_body = pose;
  sample.sequence = sequence;
  return sample;
}

/// A body that moves straight and turns about one axis of its own, both evenly.
struct EvenMotion {
  Vector3d velocity{0.5, -0.3, 0.2};
  Vector3d angular_velocity{0.4, 0.8, -0.2};
  [[nodiscard]] RigidTransform at(double seconds) const {
    const Quaterniond start = Quaterniond(0.5, -0.5, 0.1, 0.7).normalized();
    const double angle = angular_velocity.norm() * seconds;
    return {start * Quaterniond(Eigen::AngleAxisd(angle, angular_velocity.normalized())),
            Vector3d(1, 2, -1) + velocity * seconds};
  }
};

/// On a circle of 0.5 m at 1 rad/s, facing its centre: 0.5 m/s.
RigidTransform circling(double seconds) {
  const Vector3d eye(0.5 * std::sin(seconds), 0, 0.5 * std::cos(seconds));
  return look_at(eye, Vector3d::Zero(), Vector3d::UnitY());
}

template <class Motion>
void feed(PoseTrack& track, const Motion& motion, int count, double rate_hz = kRate_hz) {
  for (int i = 0; i < count; ++i) {
    const double seconds = i / rate_hz;
    // The stamp is rounded to nanoseconds; the pose is the one at the stamp.
    PoseSample sample = sample_of({}, seconds, static_cast<std::uint64_t>(i));
    sample.world_from_body = motion(to_seconds(sample.time.time_since_epoch()));
    ASSERT_EQ(track.add(sample), PoseTrack::Verdict::kTaken);
  }
}

void expect_near(const PoseEstimate& estimate,
                 const RigidTransform& truth,
                 double tolerance,
                 double when) {
  EXPECT_LT((estimate.world_from_body.translation - truth.translation).norm(), tolerance)
      << when << " s";
  EXPECT_LT(angle_between(estimate.world_from_body.rotation, truth.rotation), tolerance)
      << when << " s";
}

TEST(PredictionOptions, RefuseWhatHasNoMeaning) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(PredictionOptions{}.check());
  for (const double bad : {-0.01, 0.3, kNan})
    EXPECT_FALSE((PredictionOptions{.horizon_s = bad}.check())) << bad;
  for (const double bad : {-0.01, 0.0, kNan, HUGE_VAL}) {
    EXPECT_FALSE((PredictionOptions{.decay_s = bad}.check())) << bad;
    EXPECT_FALSE((PredictionOptions{.velocity_window_s = bad}.check())) << bad;
  }
  EXPECT_TRUE((PredictionOptions{.velocity_window_s = 0.1}.check()));
  EXPECT_FALSE((PredictionOptions{.velocity_window_s = 0.101}.check())) << "longer than the ring";
}

TEST(PoseTrack, KnowsNothingAtFirst) {
  const PoseTrack track{{}};
  EXPECT_EQ(track.at(at_seconds(1)).origin, PoseOrigin::kNone);
}

TEST(PoseTrack, PredictsEvenMotionExactly) {
  for (const double rate_hz : {10.0, 30.0, 240.0, 1000.0}) {
    PoseTrack track{{}};
    const EvenMotion motion;
    feed(
        track, [&](double s) { return motion.at(s); }, 100, rate_hz);
    const double newest = 99 / rate_hz;
    for (const double ahead : {0.0, 0.001, 0.02, 0.049}) {
      const PoseEstimate estimate = track.at(at_seconds(newest + ahead));
      expect_near(estimate, motion.at(newest + ahead), 4 * kRoundingTolerance, newest + ahead);
      EXPECT_LT((estimate.velocity - motion.velocity).norm(), 1e-6) << rate_hz;  // 1 ns of 1 ms
      EXPECT_LT((estimate.angular_velocity - motion.angular_velocity).norm(), 1e-6) << rate_hz;
      EXPECT_EQ(estimate.origin, ahead == 0 ? PoseOrigin::kInterpolated : PoseOrigin::kPredicted);
      EXPECT_EQ(estimate.age, at_seconds(newest + ahead) - at_seconds(newest));
    }
  }
}

TEST(PoseTrack, PredictsATurnOfMoreThanHalfARoundInItsWindow) {
  PoseTrack track{{.velocity_window_s = 0.1}};
  const EvenMotion spin{.velocity = Vector3d::Zero(), .angular_velocity = Vector3d(0, 0, 60)};
  feed(
      track, [&](double s) { return spin.at(s); }, 100);
  const double when = 99 / kRate_hz + 0.03;
  expect_near(
      track.at(at_seconds(when)), spin.at(when), 80 * kRoundingTolerance, when);  // 60 rad/s x 1 ns
}

/// The velocity of a body that stood until `bend_s` and has moved at 1 m/s since, by a line of
/// least squares through samples of `rate_hz` over `window_s`.
double slope_past_a_bend(double window_s, double rate_hz, double bend_s, double newest_s) {
  const double count = std::round(window_s * rate_hz) + 1;
  double t = 0;
  double tt = 0;
  double x = 0;
  double tx = 0;
  for (int i = 0; i < count; ++i) {
    const double time = -i / rate_hz;
    const double place = std::max(0.0, newest_s + time - bend_s);
    t += time;
    tt += time * time;
    x += place;
    tx += time * place;
  }
  return (count * tx - t * x) / (count * tt - t * t);
}

TEST(PoseTrack, HoldsAWholeVelocityWindowOfTheFastestTracker) {
  constexpr double kFastest_hz = 10000;
  constexpr double kBend_s = 0.28;
  constexpr double kNewest_s = 0.2999;
  for (const double window_s : {0.03, 0.1}) {
    PoseTrack track{{.velocity_window_s = window_s}};
    const auto bent = [&](double s) {
      return RigidTransform{Quaterniond::Identity(), Vector3d(std::max(0.0, s - kBend_s), 0, 0)};
    };
    feed(track, bent, 3000, kFastest_hz);
    // A window cut short by the ring would see less of the standstill.
    EXPECT_NEAR(track.at(at_seconds(kNewest_s)).velocity.x(),
                slope_past_a_bend(window_s, kFastest_hz, kBend_s, kNewest_s),
                1e-6)
        << window_s;
  }
}

TEST(PoseTrack, OfAFasterTrackerTheWindowIsWhatTheRingHolds) {
  constexpr double kRate = 100000;
  PoseTrack track{{.velocity_window_s = 0.1}};
  const auto bent = [](double s) {
    return RigidTransform{Quaterniond::Identity(), Vector3d(std::max(0.0, s - 0.025), 0, 0)};
  };
  feed(track, bent, 3000, kRate);
  EXPECT_NEAR(track.at(at_seconds(0.02999)).velocity.x(),
              slope_past_a_bend(1023 / kRate, kRate, 0.025, 0.02999),
              1e-6);
}

TEST(PoseTrack, InterpolatesEvenMotionExactly) {
  PoseTrack track{{}};
  const EvenMotion motion;
  feed(
      track, [&](double s) { return motion.at(s); }, 100);
  Pcg32 random(1);
  for (int i = 0; i < 200; ++i) {
    const double when = (99 - 60 * random.uniform()) / kRate_hz;
    const PoseEstimate estimate = track.at(at_seconds(when));
    EXPECT_EQ(estimate.origin, PoseOrigin::kInterpolated);
    EXPECT_LT(estimate.age.count(), 0);
    expect_near(estimate, motion.at(when), 2 * kRoundingTolerance, when);
    EXPECT_LT((estimate.velocity - motion.velocity).norm(), 1e-6);
    EXPECT_LT((estimate.angular_velocity - motion.angular_velocity).norm(), 1e-6);
  }
}

TEST(PoseTrack, HoldsTheOldestPoseBeforeItsHistory) {
  PoseTrack track{{}};
  feed(track, circling, 1200);
  const PoseEstimate estimate = track.at(at_seconds(0));
  EXPECT_EQ(estimate.origin, PoseOrigin::kHeld);
  EXPECT_EQ(estimate.velocity, Vector3d::Zero().eval());
  // One of the 1024 newest, the oldest of which the next sample will replace.
  expect_near(estimate, circling(177 / kRate_hz), 1.5 / kRate_hz, 0);
}

TEST(PoseTrack, MeetsTheAcceptanceBoundOnACircle) {
  PoseTrack track{{}};
  feed(track, circling, 100);
  const double newest = 99 / kRate_hz;
  const PoseEstimate estimate = track.at(at_seconds(newest + 0.02));
  const RigidTransform truth = circling(newest + 0.02);
  EXPECT_LT((estimate.world_from_body.translation - truth.translation).norm(), 1e-3);
  EXPECT_LT(angle_between(estimate.world_from_body.rotation, truth.rotation),
            0.1 * std::numbers::pi / 180);
}

TEST(PoseTrack, IsContinuousAtTheNewestSampleAndAtTheHorizon) {
  const PredictionOptions options;
  PoseTrack track{options};
  Pcg32 random(2);
  for (int i = 0; i < 20;
       ++i) {  // noisy, so that the fitted line does not pass through the newest sample
    RigidTransform pose = circling(i / kRate_hz);
    pose.translation += 1e-3 * Vector3d(random.normal(), random.normal(), random.normal());
    track.add(sample_of(pose, i / kRate_hz, static_cast<std::uint64_t>(i)));
  }
  const double newest = 19 / kRate_hz;
  for (const double edge : {newest, newest + options.horizon_s}) {
    const PoseEstimate before = track.at(at_seconds(edge) - Duration{10});
    const PoseEstimate after = track.at(at_seconds(edge) + Duration{10});
    // 20 ns at no more than 10 m/s and 10 rad/s.
    expect_near(before, after.world_from_body, 2e-7, edge);
  }
}

TEST(PoseTrack, VelocitiesDecayToAStandstillBeyondTheHorizon) {
  const PredictionOptions options;
  PoseTrack track{options};
  const EvenMotion motion;
  feed(
      track, [&](double s) { return motion.at(s); }, 20);
  const double newest = 19 / kRate_hz;
  // The integral of a velocity that stays for the horizon and then decays.
  const double total_s = options.horizon_s + options.decay_s;
  const PoseEstimate end = track.at(at_seconds(newest + 10));
  EXPECT_EQ(end.origin, PoseOrigin::kHeld);
  EXPECT_LT(end.velocity.norm(), 1e-12);
  expect_near(end, motion.at(newest + total_s), 4 * kRoundingTolerance, newest + 10);
  // Its derivative is the velocity.
  for (const double ahead : {0.02, 0.07, 0.1, 0.2}) {
    const PoseEstimate a = track.at(at_seconds(newest + ahead) - Duration{100000});
    const PoseEstimate b = track.at(at_seconds(newest + ahead) + Duration{100000});
    const Vector3d velocity =
        (b.world_from_body.translation - a.world_from_body.translation) / 2e-4;
    EXPECT_LT((velocity - track.at(at_seconds(newest + ahead)).velocity).norm(), 1e-5) << ahead;
  }
}

TEST(PoseTrack, HoldsASingleSample) {
  PoseTrack track{{}};
  track.add(sample_of(circling(0), 0, 7));
  for (const double when : {-1.0, 0.0, 0.01, 5.0}) {
    const PoseEstimate estimate = track.at(at_seconds(when));
    expect_near(estimate, circling(0), 1e-12, when);
    EXPECT_EQ(estimate.velocity, Vector3d::Zero().eval());
  }
}

TEST(PoseTrack, TakesNoVelocityFromSamplesThatLieTooCloseTogether) {
  PoseTrack track{{}};
  track.add(sample_of({Quaterniond::Identity(), Vector3d(0, 0, 0)}, 0, 0));
  PoseSample next = sample_of({Quaterniond::Identity(), Vector3d(0.001, 0, 0)}, 0, 1);
  next.time += Duration{1};
  track.add(next);
  EXPECT_EQ(track.at(at_seconds(0.02)).world_from_body.translation, Vector3d(0.001, 0, 0));
}

TEST(PoseTrack, TakesNoVelocityFromBeforeALongGap) {
  PoseTrack track{{}};
  feed(track, circling, 20);
  track.add(sample_of({Quaterniond::Identity(), Vector3d(3, 0, 0)}, 1, 100));
  EXPECT_EQ(track.at(at_seconds(1.02)).world_from_body.translation, Vector3d(3, 0, 0));
}

TEST(PoseTrack, QAndMinusQAreOneRotation) {
  PoseTrack plain{{}};
  PoseTrack flipped{{}};
  for (int i = 0; i < 50; ++i) {
    PoseSample sample =
        sample_of(circling(i / kRate_hz), i / kRate_hz, static_cast<std::uint64_t>(i));
    plain.add(sample);
    if (i % 3 == 1) sample.world_from_body.rotation.coeffs() *= -1;
    flipped.add(sample);
  }
  for (const double when : {0.1, 0.15, 49 / kRate_hz, 0.23}) {
    EXPECT_EQ(plain.at(at_seconds(when)).world_from_body.rotation.coeffs(),
              flipped.at(at_seconds(when)).world_from_body.rotation.coeffs());
  }
}

TEST(PoseTrack, SaysWhatItDidWithASample) {
  PoseTrack track{{}};
  const PoseSample sample = sample_of(circling(0), 1, 5);
  EXPECT_EQ(track.add(sample), PoseTrack::Verdict::kTaken);
  EXPECT_EQ(track.add(sample), PoseTrack::Verdict::kDuplicate);
  EXPECT_EQ(track.add(sample_of(circling(0), 1, 6)), PoseTrack::Verdict::kLate);
  EXPECT_EQ(track.add(sample_of(circling(0), 0.5, 6)), PoseTrack::Verdict::kLate);
  EXPECT_EQ(track.add(sample_of(circling(0), 2, 5)), PoseTrack::Verdict::kDuplicate);  // sent twice
  EXPECT_EQ(track.add(sample_of(circling(0), 2, 0)),
            PoseTrack::Verdict::kTaken);  // device restarted
  EXPECT_EQ(track.at(at_seconds(1)).origin, PoseOrigin::kInterpolated);
}

TEST(PoseTrack, NormalisesAQuaternionThatIsNearlyOfUnitLengthAndDropsOthers) {
  for (const double length : {0.0, 0.5, 0.89, 0.95, 1.05, 1.11, 2.0}) {
    PoseTrack track{{}};
    PoseSample sample = sample_of(circling(0.3), 0, 0);
    sample.world_from_body.rotation.coeffs() *= length;
    const bool good = length > 0.9 && length < 1.1;
    EXPECT_EQ(track.add(sample), good ? PoseTrack::Verdict::kTaken : PoseTrack::Verdict::kInvalid)
        << length;
    if (good) {
      EXPECT_NEAR(track.at(at_seconds(0)).world_from_body.rotation.norm(), 1, 1e-15);
    }
  }
}

TEST(PoseTrack, NeverReturnsNanWhateverItIsFed) {
  const std::vector<double> odd{std::numeric_limits<double>::quiet_NaN(),
                                HUGE_VAL,
                                -HUGE_VAL,
                                1e30,
                                1e6,
                                -1e6,
                                1e-310,
                                0.0,
                                std::numeric_limits<double>::max(),
                                0.5,
                                1,
                                -1};
  const std::vector<Duration::rep> odd_times{std::numeric_limits<Duration::rep>::min(),
                                             -1,
                                             0,
                                             1,
                                             std::numeric_limits<Duration::rep>::max()};
  Pcg32 random(3);
  const auto pick = [&](const auto& list) { return list[random.next() % list.size()]; };
  const auto number = [&] { return random.uniform() < 0.1 ? pick(odd) : random.normal(); };
  for (int run = 0; run < 300; ++run) {
    PoseTrack track{{}};
    Duration::rep ticks = random.uniform() < 0.1 ? pick(odd_times) : 0;
    for (int i = 0; i < 100; ++i) {
      PoseSample sample;
      if (random.uniform() < 0.01) ticks = pick(odd_times);
      if (ticks < std::numeric_limits<Duration::rep>::max() / 2) {
        ticks += random.uniform() < 0.2 ? static_cast<Duration::rep>(random.next() % 3)
                                        : random.next() % 10000000;
      }
      sample.time = Time{Duration{ticks}};
      sample.sequence = random.next() % 1000;
      sample.world_from_body.translation = {number(), number(), number()};
      Quaterniond q(number(), number(), number(), number());
      if (random.uniform() < 0.9 && q.norm() > 0) q.coeffs() /= q.norm();
      sample.world_from_body.rotation = q;
      track.add(sample);
      for (const Duration::rep when : {ticks, ticks / 2, ticks - ticks / 100, pick(odd_times)}) {
        const PoseEstimate estimate = track.at(Time{Duration{when}});
        ASSERT_TRUE(estimate.world_from_body.translation.allFinite())
            << run << ", " << i << ", " << when;
        ASSERT_NEAR(estimate.world_from_body.rotation.norm(), 1, 1e-12)
            << run << ", " << i << ", " << when;
        ASSERT_TRUE(estimate.velocity.allFinite() && estimate.angular_velocity.allFinite());
      }
    }
  }
}

TEST(PoseTrack, AskingDoesNotAllocate) {
  const int at_start = allocations;
  ::operator delete(::operator new(16));
  if (allocations == at_start)
    GTEST_SKIP() << "a sanitizer allocates, which this test cannot count";
  PoseTrack track{{}};
  feed(track, circling, 100);
  const int before = allocations;
  double sum = 0;
  for (int i = 0; i < 100; ++i)
    sum += track.at(at_seconds(0.3 + i * 0.01)).world_from_body.translation.x();
  EXPECT_EQ(allocations, before) << sum;
}

TEST(PoseTrack, HandsOverWholePosesBetweenThreads) {
  PoseTrack track{{}};
  // Each pose is a number of its own, told three times in each half: what is interpolated or
  // predicted from whole poses keeps x : y : z = 1 : 2 : 4, what is put together of two does not.
  const Vector3d axis = Vector3d(1, 2, 4).normalized();
  std::vector<RigidTransform> poses;  // made beforehand, so that the writer does little but write
  Pcg32 random(4);
  for (int i = 0; i < 1024; ++i) {
    const double a = random.uniform();
    poses.push_back({Quaterniond(Eigen::AngleAxisd(2 * random.uniform() - 1, axis)),
                     Vector3d(a, 2 * a, 4 * a)});
  }
  std::atomic<Duration::rep> newest{0};
  const auto add = [&](std::uint64_t i) {
    PoseSample sample;
    sample.sequence = i;
    sample.time = Time{Duration{1000000 * static_cast<Duration::rep>(i)}};
    sample.world_from_body = poses[i % poses.size()];
    track.add(sample);
    newest.store(sample.time.time_since_epoch().count());
  };
  add(0);
  std::atomic<bool> done{false};
  std::thread writer([&] {
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(800);
    for (std::uint64_t i = 1; i % 1024 != 0 || std::chrono::steady_clock::now() < end; ++i) add(i);
    done = true;
  });
  int asked = 0;
  int torn = 0;
  int lost = 0;
  while (!done) {
    // Ahead, and all the way to the old end, where reader and writer meet in one slot.
    const Time when{Duration{newest.load() + 1000000 - asked % 1024 * 1000000L - asked % 3}};
    const PoseEstimate estimate = track.at(when);
    const Vector3d& p = estimate.world_from_body.translation;
    const Vector3d v = estimate.world_from_body.rotation.vec();
    // Velocities reach 1 m/ms, carried a few ms ahead: some thousand ulp of 1.
    const bool whole =
        std::abs(p.y() - 2 * p.x()) + std::abs(p.z() - 4 * p.x()) < 1e-9 * (1 + p.norm()) &&
        std::abs(v.y() - 2 * v.x()) + std::abs(v.z() - 4 * v.x()) < 1e-9;
    torn += whole ? 0 : 1;
    lost += estimate.origin == PoseOrigin::kNone ? 1 : 0;
    ++asked;
  }
  writer.join();
  EXPECT_EQ(torn, 0) << "of " << asked;
  EXPECT_EQ(lost, 0) << "of " << asked;
  EXPECT_GT(asked, 100);
}

TEST(PoseTrack, NothingReachesFromOneEpochIntoAnother) {
  using std::chrono::milliseconds;
  PoseTrack track{{}};
  for (int i = 0; i < 20; ++i) {
    PoseSample sample;
    sample.sequence = static_cast<std::uint64_t>(i);
    sample.time = Time{milliseconds(10 * i)};
    // 1 m/s, a jump of 3 m in the middle, 1 m/s again.
    sample.world_from_body.translation = {0.01 * i + (i < 10 ? 0 : 3), 0, 0};
    sample.epoch = i < 10 ? 4 : 5;
    ASSERT_EQ(track.add(sample), PoseTrack::Verdict::kTaken);
    const PoseEstimate ahead = track.at(sample.time + milliseconds(10));
    const bool first_of_epoch = i == 0 || i == 10;
    EXPECT_NEAR(ahead.velocity.x(), first_of_epoch ? 0 : 1, 1e-9) << i;
  }
  const PoseEstimate between = track.at(Time{milliseconds(95)});
  EXPECT_EQ(between.origin, PoseOrigin::kHeld);
  EXPECT_NEAR(between.world_from_body.translation.x(), 0.09, 1e-12);
  EXPECT_EQ(track.at(Time{milliseconds(105)}).origin, PoseOrigin::kInterpolated);
}

}  // namespace
}  // namespace veneer::tracking
