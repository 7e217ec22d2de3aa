// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/registration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace veneer::geometry {
namespace {

constexpr double kExact = 1e-9;  // rounding of what is solved without noise, metres and radians

Eigen::Vector3d noise_of(Pcg32& random, double deviation) {
  return deviation * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

RigidTransform random_pose(Pcg32& random, double most_turn, double most_shift) {
  const Eigen::Vector3d axis = noise_of(random, 1).normalized();
  RigidTransform pose;
  pose.rotation = Eigen::AngleAxisd(most_turn * random.uniform(), axis);
  pose.translation =
      most_shift *
      Eigen::Vector3d(2 * random.uniform() - 1, 2 * random.uniform() - 1, 2 * random.uniform() - 1);
  return pose;
}

double turn_between(const RigidTransform& a, const RigidTransform& b) {
  return a.rotation.angularDistance(b.rotation);
}

struct PointSet {
  RigidTransform b_from_a;
  std::vector<PointPair> pairs;
};

PointSet touched(int count, double noise, std::uint64_t seed) {
  Pcg32 random(seed);
  PointSet set;
  set.b_from_a = random_pose(random, 3, 1);
  for (int i = 0; i < count; ++i) {
    PointPair pair;
    pair.x_in_a = 0.2 * Eigen::Vector3d(random.uniform(), random.uniform(), random.uniform());
    pair.x_in_b = set.b_from_a * pair.x_in_a + noise_of(random, noise);
    set.pairs.push_back(pair);
  }
  return set;
}

TEST(PointRegistration, IsExactWithoutNoise) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const PointSet set = touched(4 + static_cast<int>(seed), 0, seed);
    const auto result = register_points(set.pairs);
    ASSERT_TRUE(result) << result.error().what;
    EXPECT_LT((result->b_from_a.translation - set.b_from_a.translation).norm(), kExact) << seed;
    EXPECT_LT(turn_between(result->b_from_a, set.b_from_a), 1e-7) << seed;
    EXPECT_LT(result->held_out_m, kExact) << seed;
  }
}

TEST(PointRegistration, KnowsItsOwnErrors) {
  constexpr double kNoise = 1e-3;
  double turns = 0;
  double stated = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const PointSet set = touched(12, kNoise, seed);
    const auto result = register_points(set.pairs);
    ASSERT_TRUE(result) << result.error().what;
    EXPECT_GT(result->held_out_m, result->rms_m) << seed;
    turns += std::pow(turn_between(result->b_from_a, set.b_from_a), 2);
    stated += std::pow(result->rotation_deviation_rad, 2);
  }
  // A turning has three components, of which the worst is stated.
  EXPECT_LT(turns, 4 * stated);
  EXPECT_GT(turns, 0.7 * stated);
}

TEST(PointRegistration, LeavesGrossErrorsOut) {
  PointSet set = touched(10, 5e-4, 3);
  set.pairs[2].x_in_b.x() += 0.05;
  std::swap(set.pairs[5].x_in_b, set.pairs[6].x_in_b);
  const auto result = register_points(set.pairs);
  ASSERT_TRUE(result) << result.error().what;
  for (std::size_t i = 0; i < set.pairs.size(); ++i)
    EXPECT_EQ(result->inlier[i], i != 2 && i != 5 && i != 6) << i;
  EXPECT_LT((result->b_from_a * set.pairs[2].x_in_a - set.b_from_a * set.pairs[2].x_in_a).norm(),
            2e-3);
}

TEST(PointRegistration, RefusesALineAndTooFewAndNoAgreement) {
  PointSet set = touched(8, 0, 1);
  for (std::size_t i = 0; i < set.pairs.size(); ++i) {
    set.pairs[i].x_in_a = {0.03 * static_cast<double>(i), 0, 0};
    set.pairs[i].x_in_b = set.b_from_a * set.pairs[i].x_in_a;
  }
  auto refused = register_points(set.pairs);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);
  EXPECT_NE(refused.error().what.find("one line"), std::string::npos) << refused.error().what;
  EXPECT_EQ(register_points(std::span(set.pairs).first(3)).error().code, Errc::kInvalidOption);

  set = touched(8, 0, 1);
  Pcg32 random(9);
  for (PointPair& pair : set.pairs) pair.x_in_b = noise_of(random, 0.3);
  EXPECT_EQ(register_points(set.pairs).error().code, Errc::kBadFormat);
  set.pairs[1].x_in_b.x() = NAN;
  EXPECT_EQ(register_points(set.pairs).error().code, Errc::kInvalidOption);
}

struct BoardSet {
  RigidTransform world_from_projector;
  RigidTransform board_from_sensor;
  std::vector<BoardPose> poses;
};

/// @param one_axis  the board turns about the vertical alone.
BoardSet boards(int count, double noise_m, double noise_rad, bool one_axis, std::uint64_t seed) {
  Pcg32 random(seed);
  BoardSet set;
  set.world_from_projector = random_pose(random, 3, 2);
  set.board_from_sensor = random_pose(random, 3, 0.1);
  for (int i = 0; i < count; ++i) {
    BoardPose pose;
    pose.name = fmt::format("{}", i);
    pose.projector_from_board = random_pose(random, 1, 0.4);
    if (one_axis)
      pose.projector_from_board.rotation = Eigen::AngleAxisd(0.2 * i, Eigen::Vector3d::UnitY());
    pose.projector_from_board.translation.z() += 2;
    RigidTransform error;
    const Eigen::Vector3d turn = noise_of(random, noise_rad);
    if (turn.norm() > 0) error.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized());
    pose.world_from_sensor.world_from_body =
        set.world_from_projector * pose.projector_from_board * set.board_from_sensor * error;
    pose.world_from_sensor.world_from_body.translation += noise_of(random, noise_m);
    set.poses.push_back(pose);
  }
  return set;
}

TEST(BoardRegistration, IsExactWithoutNoise) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const BoardSet set = boards(6, 0, 0, false, seed);
    const auto result = register_boards(set.poses);
    ASSERT_TRUE(result) << result.error().what;
    EXPECT_LT(
        (result->world_from_projector.translation - set.world_from_projector.translation).norm(),
        1e-7)
        << seed;
    EXPECT_LT(turn_between(result->world_from_projector, set.world_from_projector), 1e-7) << seed;
    EXPECT_LT(turn_between(result->board_from_sensor, set.board_from_sensor), 1e-7) << seed;
    EXPECT_LT(result->held_out_position_m, 1e-7) << seed;
  }
}

TEST(BoardRegistration, HoldsWithNoiseAndGrossErrors) {
  BoardSet set = boards(12, 1e-3, 1e-3, false, 2);
  set.poses[3].world_from_sensor.world_from_body.translation.y() += 0.1;
  set.poses[8].world_from_sensor.world_from_body.rotation =
      set.poses[8].world_from_sensor.world_from_body.rotation *
      Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()));
  const auto result = register_boards(set.poses);
  ASSERT_TRUE(result) << result.error().what;
  for (std::size_t i = 0; i < set.poses.size(); ++i)
    EXPECT_EQ(result->inlier[i], i != 3 && i != 8) << i;
  // Five of the deviations that the result states of itself, for the largest of six numbers.
  EXPECT_LT(
      (result->world_from_projector.translation - set.world_from_projector.translation).norm(),
      5 * result->position_deviation_m);
  EXPECT_LT(turn_between(result->world_from_projector, set.world_from_projector),
            5 * result->rotation_deviation_rad);
  EXPECT_LT(result->position_deviation_m, 0.01);
  EXPECT_GT(result->held_out_position_m, result->position_rms_m);
}

TEST(BoardRegistration, RefusesTurningsAboutOneAxis) {
  const BoardSet set = boards(8, 1e-3, 1e-3, true, 4);
  const auto refused = register_boards(set.poses);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadFormat);
  EXPECT_NE(refused.error().what.find("second one"), std::string::npos) << refused.error().what;
  EXPECT_EQ(register_boards(std::span(set.poses).first(3)).error().code, Errc::kInvalidOption);
}

constexpr Lens kProjector{3000, 3000, 960, 900, -0.1, 0.1};

struct TouchSet {
  RigidTransform world_from_projector;
  std::vector<PixelTouch> touches;
};

TouchSet touches(int count, double noise_px, std::uint64_t seed) {
  Pcg32 random(seed);
  TouchSet set;
  set.world_from_projector = random_pose(random, 3, 2);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d in_projector(
        0.6 * random.uniform() - 0.3, 0.5 * random.uniform() - 0.25, 1.8 + 0.5 * random.uniform());
    PixelTouch touch;
    touch.pixel = kProjector.project(in_projector) +
                  noise_px * Eigen::Vector2d(random.normal(), random.normal());
    touch.x_in_world = set.world_from_projector * in_projector;
    set.touches.push_back(touch);
  }
  return set;
}

TEST(PixelRegistration, IsExactWithoutNoise) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const TouchSet set = touches(8, 0, seed);
    const auto result = register_pixels(set.touches, kProjector);
    ASSERT_TRUE(result) << result.error().what;
    EXPECT_LT(
        (result->world_from_projector.translation - set.world_from_projector.translation).norm(),
        1e-7)
        << seed;
    EXPECT_LT(result->held_out_px, 1e-5) << seed;
  }
}

TEST(PixelRegistration, HoldsWithNoiseAndGrossErrors) {
  TouchSet set = touches(16, 1, 3);
  set.touches[1].pixel.x() += 200;
  set.touches[7].x_in_world.z() += 0.1;
  const auto result = register_pixels(set.touches, kProjector);
  ASSERT_TRUE(result) << result.error().what;
  for (std::size_t i = 0; i < set.touches.size(); ++i)
    EXPECT_EQ(result->inlier[i], i != 1 && i != 7) << i;
  EXPECT_LT(
      (result->world_from_projector.translation - set.world_from_projector.translation).norm(),
      5 * result->position_deviation_m);
  EXPECT_GT(result->held_out_px, result->rms_px);
}

TEST(PixelRegistration, RefusesALineAndTooFew) {
  TouchSet set = touches(8, 0, 1);
  for (std::size_t i = 0; i < set.touches.size(); ++i) {
    const Eigen::Vector3d in_projector(0.05 * static_cast<double>(i) - 0.2, 0, 2);
    set.touches[i] = {kProjector.project(in_projector), set.world_from_projector * in_projector};
  }
  const auto refused = register_pixels(set.touches, kProjector);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find("one line"), std::string::npos) << refused.error().what;
  EXPECT_EQ(register_pixels(std::span(set.touches).first(5), kProjector).error().code,
            Errc::kInvalidOption);
  EXPECT_EQ(register_pixels(set.touches, {}).error().code, Errc::kInvalidOption);
}

TEST(TouchedPoint, CarriesTheTrackersTurningToTheTip) {
  tracking::SynchronisedPose stylus;
  stylus.position_deviation_m = 3e-4;
  stylus.rotation_deviation_rad = 2e-3;
  const TouchedPoint point = touched_point(stylus, {0, 0, 0.2});
  EXPECT_EQ(point.x_in_world, Eigen::Vector3d(0, 0, 0.2));
  EXPECT_DOUBLE_EQ(point.deviation_m, 5e-4);  // 3 and 4 tenths of a millimetre
}

}  // namespace
}  // namespace veneer::geometry
