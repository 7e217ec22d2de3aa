// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "base/random.h"
#include "simulation/studio/testing.h"

namespace veneer::simulation::studio {
namespace {

using simulation::testing::kDegree;
using simulation::testing::on_arc;
using simulation::testing::small_plan;
using simulation::testing::small_truth;
using ::testing::HasSubstr;

StudioGeometry made(const StudioTruth& truth, const capture::CapturePlan& plan) {
  auto geometry = StudioGeometry::create(truth, plan);
  EXPECT_TRUE(geometry) << geometry.error().what;
  return *geometry;
}

TEST(StudioGeometry, APointFallsWhereLensAndPoseSay) {
  StudioTruth truth = small_truth();
  truth.k1 = -0.5;
  truth.k2 = 20;
  truth.principal_point = {83, 57};
  const StudioGeometry geometry = made(truth, small_plan());
  // View 1 stands 20 degrees towards x. By hand: the camera's x axis is (cos, 0, -sin), y is down
  // the board, z is towards the sample.
  const double sine = std::sin(20 * kDegree);
  const double cosine = std::cos(20 * kDegree);
  const Eigen::Vector3d point(12, 7, -3);
  const double right = cosine * point.x() - sine * point.z();
  const double depth = 800 - (sine * point.x() + cosine * point.z());
  const Eigen::Vector2d slope(right / depth, -point.y() / depth);
  const double u = slope.squaredNorm();
  const Eigen::Vector2d wanted =
      1600 * (1 - 0.5 * u + 20 * u * u) * slope + Eigen::Vector2d(83, 57);
  EXPECT_NEAR((geometry.pixel(geometry.local_from_camera(1), point) - wanted).norm(), 0, 1e-9);
}

TEST(StudioGeometry, RaysGoThroughThePointsThatTheirPixelsSee) {
  Pcg32 random(1);
  for (const auto& [k1, k2] : {std::pair{0.0, 0.0}, {-4.0, 0.0}, {3.0, 50.0}, {-3.0, 100.0}}) {
    StudioTruth truth = small_truth();
    truth.focal_px = 400;
    truth.k1 = k1 * 0.1;
    truth.k2 = k2 * 0.01;
    ASSERT_TRUE(truth.check());
    const StudioGeometry geometry = made(truth, small_plan());
    for (int view = 0; view < 2; ++view) {
      const RigidTransform pose = geometry.local_from_camera(view);
      for (int i = 0; i < 100; ++i) {
        const Eigen::Vector2d pixel(160 * random.uniform(), 120 * random.uniform());
        const auto ray = geometry.ray(pose, pixel);
        EXPECT_NEAR(ray.direction.norm(), 1, 1e-12);
        const auto point = meet_plane(ray, 0);
        ASSERT_TRUE(point);
        EXPECT_NEAR(point->z(), 0, 1e-9);
        EXPECT_NEAR((geometry.pixel(pose, *point) - pixel).norm(), 0, 1e-8)
            << pixel.transpose() << ", k1 " << truth.k1;
      }
      // The axis itself, where the distortion's radius is 0.
      EXPECT_NEAR(geometry.ray(pose, truth.principal_point)
                      .direction.dot(pose.rotation * Eigen::Vector3d::UnitZ()),
                  1,
                  1e-12);
    }
  }
}

TEST(StudioGeometry, TheBoardsTopIsUpAndTheFirstTexelTopLeft) {
  const StudioGeometry geometry = made(small_truth(), small_plan());
  const RigidTransform pose = geometry.local_from_camera(0);
  const auto at = [&](double x, double y) {
    return geometry.texel(*meet_plane(geometry.ray(pose, {x, y}), 0));
  };
  // The sample covers 32 x 32 pixels around the picture's middle, texels 4 x 4.
  EXPECT_EQ(at(64.5, 44.5), 0U);
  EXPECT_EQ(at(95.5, 44.5), 7U);
  EXPECT_EQ(at(64.5, 75.5), 56U);
  EXPECT_EQ(at(69, 50), 9U);
  EXPECT_FALSE(at(63.9, 50));
  EXPECT_FALSE(at(96.1, 50));
  EXPECT_FALSE(at(70, 43.9));
  EXPECT_FALSE(at(70, 76.1));
  // Of the board, whose corner is 25 mm left of the sample and 19 mm above it.
  EXPECT_NEAR((geometry.board_place({-8, 8, 0}) - Eigen::Vector2d(25, 19)).norm(), 0, 1e-12);
  EXPECT_NEAR(
      ((geometry.local_from_board() * Eigen::Vector3d(25, 19, 0)) - Eigen::Vector3d(-8, 8, 0))
          .norm(),
      0,
      1e-12);
}

TEST(StudioGeometry, ALiftedSampleStandsTowardsTheCamera) {
  capture::CapturePlan plan = small_plan();
  plan.area.lift_mm = 3;
  const StudioGeometry geometry = made(small_truth(), plan);
  EXPECT_EQ(geometry.board_z(), -3);
  EXPECT_NEAR((geometry.local_from_board() * Eigen::Vector3d(0, 0, -3)).z(), 0, 1e-12);
  // The camera looks at the middle of the sample, not of the board below.
  EXPECT_NEAR((geometry.pixel(geometry.local_from_camera(1), Eigen::Vector3d::Zero()) -
               Eigen::Vector2d(80, 60))
                  .norm(),
              0,
              1e-9);
}

TEST(StudioGeometry, RaysThatRiseOrBeginBelowMeetNoPlane) {
  const Eigen::Vector3d up(0, 0.6, 0.8);
  EXPECT_FALSE(meet_plane({{0, 0, 5}, up}, 0));
  EXPECT_FALSE(meet_plane({{0, 0, 5}, Eigen::Vector3d::UnitX()}, 0));
  EXPECT_FALSE(meet_plane({{0, 0, -5}, -up}, 0));
  EXPECT_TRUE(meet_plane({{0, 0, 5}, -up}, 0));
}

TEST(StudioGeometry, ThePlacesOfRaysShareNoColumnOrRowAndLieEvenly) {
  const StudioGeometry geometry = made(small_truth(), small_plan());
  std::set<double> columns;
  std::set<double> rows;
  Eigen::Vector2d mean(0, 0);
  for (const Eigen::Vector2d& place : geometry.ray_places()) {
    columns.insert(place.x());
    rows.insert(place.y());
    mean += place / StudioGeometry::kRays;
  }
  EXPECT_EQ(columns.size(), std::size_t{StudioGeometry::kRays});
  EXPECT_EQ(rows.size(), std::size_t{StudioGeometry::kRays});
  EXPECT_NEAR((mean - Eigen::Vector2d(0.5, 0.5)).norm(), 0, 1e-12);
}

TEST(StudioGeometry, LightFallsOffToTheCorners) {
  StudioTruth truth = small_truth();
  truth.light_fall_off = 0.2;
  truth.vignetting = 0.3;
  const StudioGeometry geometry = made(truth, small_plan());
  EXPECT_NEAR(geometry.fall_off({0, 0, 0}), 1, 1e-12);
  EXPECT_NEAR(geometry.fall_off({33, 27, 0}), 0.8, 1e-12);
  EXPECT_NEAR(geometry.fall_off({-16.5, 13.5, 0}), 0.95, 1e-12);
  EXPECT_EQ(geometry.fall_off({1e4, 0, 0}), 0);
  EXPECT_NEAR(geometry.vignetting({80, 60}), 1, 1e-12);
  EXPECT_NEAR(geometry.vignetting({0, 120}), 0.7, 1e-12);
}

TEST(StudioGeometry, WhatCannotBeIsNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto expect_refused = [](const std::function<void(capture::CapturePlan&)>& change,
                                 const char* reason) {
    capture::CapturePlan plan = small_plan();
    change(plan);
    const auto geometry = StudioGeometry::create(small_truth(), plan);
    ASSERT_FALSE(geometry) << reason;
    EXPECT_EQ(geometry.error().code, Errc::kInvalidOption);
    EXPECT_THAT(geometry.error().what, HasSubstr(reason));
  };
  expect_refused([](auto& p) { p.area.width_mm = 0; }, "0 x 16 mm");
  expect_refused([&](auto& p) { p.area.height_mm = nan; }, "16 x nan mm");
  expect_refused([&](auto& p) { p.area.left_mm = nan; }, "left_mm");
  expect_refused([](auto& p) { p.area.rows = 0; }, "8 x 0 texels");
  expect_refused([](auto& p) { p.area.rows = 9; }, "not square");
  expect_refused([](auto& p) { p.area.lift_mm = -1; }, "lift_mm is -1");
  expect_refused([](auto& p) { p.lights.clear(); }, "no lights");
  expect_refused([](auto& p) { p.views.clear(); }, "no views");
  expect_refused([](auto& p) { p.lights[1] = {0, 0, -1}; }, "number 1 of the plan's lights");
  expect_refused([&](auto& p) { p.views[0] = {nan, 0, 1}; }, "number 0 of the plan's views");
  expect_refused([](auto& p) { p.polarisation.axis = {0, 2, 0}; }, "no unit vector");
  expect_refused([](auto& p) { p.polarisation.axis = p.lights[2]; }, "along number 2");
  expect_refused([](auto& p) { p.mirror_light = 3; }, "mirror's light is 3");
  expect_refused([](auto& p) { p.ball_radius_mm = 0; }, "ball_radius_mm");
  expect_refused([](auto& p) { p.white_reflectance = 1.5; }, "reflectance is 1.5");
}

}  // namespace
}  // namespace veneer::simulation::studio
