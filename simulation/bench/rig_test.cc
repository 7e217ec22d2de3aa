// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "simulation/bench/registration.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using ::testing::HasSubstr;
using testing::truth_with_camera;

std::unique_ptr<Bench> bench_of(const BenchTruth& truth, const char* mesh = "sphere") {
  auto bench = Bench::create(truth, *load_mesh(mesh));
  EXPECT_TRUE(bench) << bench.error().what;
  return std::move(*bench);
}

TEST(VirtualRig, TracksTheBoardWithTheNoiseAskedFor) {
  BenchTruth truth = truth_with_camera();
  truth.tracker.position_noise_m = 0.001;
  truth.tracker.rotation_noise_deg = 0.5;
  truth.board->board_from_sensor = testing::turned(70, {0.6, 0, 0.8});
  truth.board->board_from_sensor.translation = {0.1, -0.02, 0.01};
  const auto bench = bench_of(truth);
  auto rig = VirtualRig::create(*bench);
  ASSERT_TRUE(rig) << rig.error().what;
  ASSERT_TRUE((*rig)->place_board(3));
  const RigidTransform sensor_from_world =
      ((*rig)->camera().board_poses()[3] * truth.board->board_from_sensor).inverse();
  double position_squares = 0;
  double rotation_squares = 0;
  constexpr int kReadings = 1000;
  for (int i = 0; i < kReadings; ++i) {
    const auto sensor = (*rig)->board_sensor();
    ASSERT_TRUE(sensor);
    EXPECT_EQ(sensor->position_deviation_m, 0.001);
    const RigidTransform error = sensor_from_world * sensor->world_from_body;
    position_squares += error.translation.squaredNorm() / (3 * kReadings);
    rotation_squares +=
        std::pow(error.rotation.angularDistance(Eigen::Quaterniond::Identity()), 2) /
        (3 * kReadings);
  }
  // Five standard errors of a deviation from 3000 components.
  const double tolerance = 5 / std::sqrt(2.0 * 3 * kReadings);
  EXPECT_NEAR(std::sqrt(position_squares) / 0.001, 1, tolerance);
  EXPECT_NEAR(std::sqrt(rotation_squares) * 180 / std::numbers::pi / 0.5, 1, tolerance);
}

TEST(VirtualRig, TouchesWhereThePointIsButForTheNoise) {
  BenchTruth truth = truth_with_camera();
  truth.tracker.position_noise_m = 0;
  const auto bench = bench_of(truth);
  auto rig = VirtualRig::create(*bench);
  ASSERT_TRUE(rig);
  EXPECT_EQ((*rig)->touch({0.1, 0.2, 0.3}), Eigen::Vector3d(0.1, 0.2, 0.3));
  const auto spot = (*rig)->touch_spot({32, 24});
  ASSERT_TRUE(spot) << spot.error().what;
  EXPECT_LE((*spot - Eigen::Vector3d(0, 0, 0.1)).norm(), 1e-5) << "the sphere's foremost point";
  const auto past = (*rig)->touch_spot({0, 0});
  ASSERT_FALSE(past);
  EXPECT_THAT(past.error().what, HasSubstr("does not fall on the object"));
}

TEST(VirtualRig, DoesTheSameForTheSameSeed) {
  const auto bench = bench_of(truth_with_camera());
  auto one = VirtualRig::create(*bench);
  auto two = VirtualRig::create(*bench);
  ASSERT_TRUE(one && two);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE((*one)->place_board(i) && (*two)->place_board(i));
    EXPECT_EQ((*one)->board_sensor()->world_from_body.matrix(),
              (*two)->board_sensor()->world_from_body.matrix());
    EXPECT_EQ((*one)->touch({0, 0, 0}), (*two)->touch({0, 0, 0}));
    EXPECT_NE((*one)->touch({0, 0, 0}), Eigen::Vector3d::Zero());
    EXPECT_NE((*two)->touch({0, 0, 0}), Eigen::Vector3d::Zero());
  }
}

TEST(VirtualRig, WithoutABoardThereIsNoSensorToAskFor) {
  const auto bench = bench_of(truth_with_camera());
  auto rig = VirtualRig::create(*bench);
  ASSERT_TRUE(rig);
  EXPECT_FALSE((*rig)->board_sensor());
  ASSERT_TRUE((*rig)->place_board(0));
  EXPECT_TRUE((*rig)->board_sensor());
  EXPECT_FALSE((*rig)->place_board(99));
  (*rig)->remove_board();
  EXPECT_FALSE((*rig)->board_sensor());
}

TEST(VirtualRig, WarmingUpPassesTheBenchsTimeAlone) {
  const auto bench = bench_of(truth_with_camera());
  auto rig = VirtualRig::create(*bench);
  ASSERT_TRUE(rig);
  (*rig)->warm_up(1800);
  EXPECT_DOUBLE_EQ(to_seconds((*rig)->display().now().time_since_epoch()), 1800);
}

TEST(Landmarks, AreSixDifferentPointsOfTheMeshOrMore) {
  for (const char* name : {"sphere", "vase"}) {
    const Mesh mesh = *load_mesh(name);
    const std::vector<Landmark> landmarks = landmarks_of(mesh);
    EXPECT_GE(landmarks.size(), 6U) << name;
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      EXPECT_THAT(mesh.positions, ::testing::Contains(landmarks[i].in_object)) << name;
      for (std::size_t j = 0; j < i; ++j) {
        EXPECT_NE(landmarks[i].in_object, landmarks[j].in_object) << name;
        EXPECT_NE(landmarks[i].name, landmarks[j].name);
      }
    }
  }
  EXPECT_TRUE(landmarks_of(Mesh{}).empty());
}

TEST(RegistrationError, IsNoneForTheTruth) {
  const auto bench = bench_of(truth_with_camera());
  const auto error = registration_error(*bench, true_geometry(*bench), {}, 2);
  ASSERT_TRUE(error) << error.error().what;
  EXPECT_GT(error->points, 100);
  EXPECT_LE(error->max_px, 1e-9);
}

TEST(RegistrationError, OfAShiftedPrincipalPointIsTheShift) {
  const auto bench = bench_of(truth_with_camera());
  calibration::ProjectorGeometry geometry = true_geometry(*bench);
  geometry.cx += 3;
  geometry.cy -= 4;
  const auto error = registration_error(*bench, geometry, {}, 2);
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->p50_px, 5, 1e-9);
  EXPECT_NEAR(error->p95_px, 5, 1e-9);
  EXPECT_NEAR(error->max_px, 5, 1e-9);
}

TEST(RegistrationError, GrowsFromTheMiddleForAWrongFocalLength) {
  const auto bench = bench_of(truth_with_camera());
  calibration::ProjectorGeometry geometry = true_geometry(*bench);
  geometry.fx *= 1.01;
  geometry.fy *= 1.01;
  const auto error = registration_error(*bench, geometry, {}, 1);
  ASSERT_TRUE(error);
  // The sphere's silhouette is 0.1 / sqrt(1 - 0.01) off the axis at 1 m, times 320 px.
  EXPECT_NEAR(error->max_px, 0.01 * 320 * 0.1 / std::sqrt(0.99), 0.01);
  EXPECT_LT(error->p50_px, error->p95_px);
}

TEST(RegistrationError, RefusesWhatCannotBeCompared) {
  const auto bench = bench_of(truth_with_camera());
  EXPECT_FALSE(registration_error(*bench, true_geometry(*bench), {}, 0));
  calibration::ProjectorGeometry behind = true_geometry(*bench);
  behind.world_from_projector.translation.z() = -3;
  const auto error = registration_error(*bench, behind);
  ASSERT_FALSE(error);
  EXPECT_THAT(error.error().what, HasSubstr("behind the lens"));
  RigidTransform away;
  away.translation.x() = 9;
  EXPECT_FALSE(registration_error(*bench, true_geometry(*bench), away));
}

}  // namespace
}  // namespace veneer::simulation
