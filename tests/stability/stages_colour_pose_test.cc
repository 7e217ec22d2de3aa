// SPDX-License-Identifier: Apache-2.0
// Colour spaces, colour differences and the prediction of poses at the ends of their domains, with
// invalid operations and divisions by zero trapped.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>

#include "base/colour.h"
#include "base/ipt.h"
#include "base/testing/fp_trap.h"
#include "tracking/pose_track.h"

namespace veneer {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

struct Colour {
  const char* name;
  Xyz xyz;  ///< relative to D65 with Y = 1
};
const Colour kColours[] = {
    {"Black", {0, 0, 0}},
    {"Denormal", {1e-310, 1e-310, 1e-310}},
    {"Grey", {0.18 * 0.9505, 0.18, 0.18 * 1.089}},
    {"White", {0.9505, 1, 1.089}},
    {"HugeWhite", {0.9505e6, 1e6, 1.089e6}},
    {"Red", {0.41, 0.21, 0.02}},
    {"Blue", {0.18, 0.07, 0.95}},
    {"Negative", {-0.1, 0.2, -0.3}},
};

class ColourDifference : public testing::TestWithParam<std::tuple<Colour, Colour>> {};
TEST_P(ColourDifference, IsSymmetricFiniteAndZeroOnlyForEquals) {
  const FpTrap trap;
  const auto& [first, second] = GetParam();
  const Xyz white(0.9505, 1, 1.089);
  const Lab a = lab_from_xyz(first.xyz, white);
  const Lab b = lab_from_xyz(second.xyz, white);
  const double forth = delta_e_2000(a, b);
  const double back = delta_e_2000(b, a);
  EXPECT_TRUE(std::isfinite(forth) && forth >= 0) << forth;
  EXPECT_NEAR(forth, back, 1e-9 * (1 + forth));
  const bool near_equal = (first.xyz - second.xyz).norm() < 1e-300;
  if (near_equal) {
    EXPECT_LT(forth, 1e-9);
  } else {
    EXPECT_GT(forth, 1);
  }
}
INSTANTIATE_TEST_SUITE_P(All,
                         ColourDifference,
                         testing::Combine(testing::ValuesIn(kColours), testing::ValuesIn(kColours)),
                         [](const auto& at) {
                           return std::string(std::get<0>(at.param).name) + "_" +
                                  std::get<1>(at.param).name;
                         });

class IptAtExtremes : public testing::TestWithParam<Colour> {};
TEST_P(IptAtExtremes, ComesBack) {
  const FpTrap trap;
  const Vector3d cones = cones_from_xyz() * GetParam().xyz;
  const Ipt ipt = ipt_from_cones(cones);
  ASSERT_TRUE(ipt.allFinite()) << ipt.transpose();
  // The power 1/0.43 and a matrix of condition 20 on some roundings.
  EXPECT_LT((cones_from_ipt(ipt) - cones).norm(), 1e-12 * cones.norm() + 1e-30);
}
INSTANTIATE_TEST_SUITE_P(All, IptAtExtremes, testing::ValuesIn(kColours), [](const auto& at) {
  return std::string(at.param.name);
});

class SrgbAtExtremes : public testing::TestWithParam<double> {};
TEST_P(SrgbAtExtremes, ComesBackAndIsOdd) {
  const FpTrap trap;
  const double x = GetParam();
  EXPECT_NEAR(srgb_decode(srgb_encode(x)), x, 1e-12 * std::abs(x));
  EXPECT_EQ(srgb_encode(-x), -srgb_encode(x));
}
// 0.0031308 is left out: the standard's two pieces meet there only to 1e-8.
INSTANTIATE_TEST_SUITE_P(All, SrgbAtExtremes, testing::Values(0.0, 1e-300, 1e-4, 0.5, 1.0, 1e6));

struct Move {
  const char* name;
  Vector3d by;
  Quaterniond turn;
};
const Move kMoves[] = {
    {"Still", {0, 0, 0}, Quaterniond::Identity()},
    {"Denormal", {1e-310, 0, 0}, Quaterniond(1, 1e-310, 0, 0)},
    {"Antipodal", {0, 0, 0}, Quaterniond(-1, 0, 0, 0)},
    {"HalfTurn", {0, 0, 0}, Quaterniond(0, 0, 1, 0)},
    {"AlmostHalfTurn", {0, 0, 0}, Quaterniond(1e-9, 0, 1, 0)},
    {"OneMetre", {1, 0, 0}, Quaterniond::Identity()},
    {"To999Kilometres", {9.99e5, 0, 0}, Quaterniond(0, 1, 0, 0)},
};
struct Step {
  const char* name;
  std::int64_t nanoseconds;
};
const Step kSteps[] = {{"OneNanosecond", 1},
                       {"OneMicrosecond", 1'000},
                       {"HalfAMillisecond", 500'000},
                       {"FourMilliseconds", 4'000'000},
                       {"OneSecond", 1'000'000'000}};

tracking::PoseSample sample_of(Time time, const Move& move, std::uint64_t sequence) {
  tracking::PoseSample sample;
  sample.time = time;
  sample.world_from_body = {move.turn, move.by};
  sample.sequence = sequence;
  return sample;
}

class PredictionAtExtremes : public testing::TestWithParam<std::tuple<Move, Step, double>> {};
TEST_P(PredictionAtExtremes, IsAPoseThatPassesThroughTheNewestAndComesToRest) {
  const FpTrap trap;
  const auto& [move, step, horizon_s] = GetParam();
  tracking::PredictionOptions options;
  options.horizon_s = horizon_s;
  ASSERT_TRUE(options.check());
  tracking::PoseTrack track(options);
  const Time first = Time{} + std::chrono::seconds(100);
  const Time newest = first + std::chrono::nanoseconds(step.nanoseconds);
  using Verdict = tracking::PoseTrack::Verdict;
  ASSERT_EQ(track.add(sample_of(first, kMoves[0], 1)), Verdict::kTaken);
  ASSERT_EQ(track.add(sample_of(newest, move, 2)), Verdict::kTaken);
  EXPECT_EQ(track.add(sample_of(newest, move, 2)), Verdict::kDuplicate);
  EXPECT_EQ(track.add(sample_of(newest, move, 3)), Verdict::kLate);
  EXPECT_EQ(track.add(sample_of(first, move, 4)), Verdict::kLate);
  for (const std::int64_t offset : {-3'600'000'000'000LL,
                                    -1'000'000'000LL,
                                    -2LL,
                                    -1LL,
                                    0LL,
                                    1LL,
                                    50'000'000LL,
                                    200'000'000LL,
                                    3'600'000'000'000LL}) {
    const auto pose = track.at(newest + std::chrono::nanoseconds(offset));
    ASSERT_TRUE(pose.world_from_body.translation.allFinite()) << offset;
    ASSERT_NEAR(pose.world_from_body.rotation.norm(), 1, 1e-9) << offset;
    ASSERT_TRUE(pose.velocity.allFinite() && pose.angular_velocity.allFinite()) << offset;
    if (offset == 0) {
      EXPECT_LT((pose.world_from_body.translation - move.by).norm(), 1e-9);
      EXPECT_LT(pose.world_from_body.rotation.angularDistance(move.turn.normalized()), 1e-6);
    }
    if (offset > 1'000'000'000) {
      EXPECT_EQ(pose.origin, tracking::PoseOrigin::kHeld);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(All,
                         PredictionAtExtremes,
                         testing::Combine(testing::ValuesIn(kMoves),
                                          testing::ValuesIn(kSteps),
                                          testing::Values(0.0, 0.2)),
                         [](const auto& at) {
                           return std::string(std::get<0>(at.param).name) + "_" +
                                  std::get<1>(at.param).name +
                                  (std::get<2>(at.param) > 0 ? "_Horizon200ms" : "_NoHorizon");
                         });

const Move kNoPoses[] = {
    {"ZeroQuaternion", {0, 0, 0}, Quaterniond(0, 0, 0, 0)},
    {"LongQuaternion", {0, 0, 0}, Quaterniond(2, 0, 0, 0)},
    {"QuaternionNoNumber", {0, 0, 0}, Quaterniond(NAN, 0, 0, 0)},
    {"PlaceNoNumber", {NAN, 0, 0}, Quaterniond::Identity()},
    {"InfinitelyFar", {0, HUGE_VAL, 0}, Quaterniond::Identity()},
    {"Beyond1000Kilometres", {1.1e6, 0, 0}, Quaterniond::Identity()},
};
class NoPose : public testing::TestWithParam<Move> {};
TEST_P(NoPose, IsDroppedAndNothingIsKnown) {
  tracking::PoseTrack track{tracking::PredictionOptions{}};
  EXPECT_EQ(track.add(sample_of(Time{} + std::chrono::seconds(1), GetParam(), 1)),
            tracking::PoseTrack::Verdict::kInvalid);
  EXPECT_EQ(track.at(Time{} + std::chrono::seconds(1)).origin, tracking::PoseOrigin::kNone);
}
INSTANTIATE_TEST_SUITE_P(All, NoPose, testing::ValuesIn(kNoPoses), [](const auto& at) {
  return std::string(at.param.name);
});

}  // namespace
}  // namespace veneer
