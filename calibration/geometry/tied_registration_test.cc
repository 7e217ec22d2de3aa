// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/tied_registration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "base/statistics.h"

namespace veneer::geometry {
namespace {

constexpr int kPoses = 8;

RigidTransform turned(const Eigen::Vector3d& rotation, const Eigen::Vector3d& translation) {
  RigidTransform pose;
  if (rotation.norm() > 0)
    pose.rotation = Eigen::AngleAxisd(rotation.norm(), rotation.normalized());
  pose.translation = translation;
  return pose;
}

Eigen::Vector3d normals(Pcg32& random, double deviation) {
  return {deviation * random.normal(), deviation * random.normal(), deviation * random.normal()};
}

/// A projector a good metre in front of boards that tilt all ways, and a tracker.
struct Scene {
  Lens lens{2000, 2000, 320, 240};
  RigidTransform world_from_projector = turned({0.1, 2.6, -0.2}, {0.3, 0.4, 1.2});
  RigidTransform board_from_sensor = turned({0.3, -0.2, 1.2}, {0.16, 0.02, 0.015});
  std::vector<View> views;
  std::vector<tracking::SynchronisedPose> sensors;
  BoardRegistration start;

  Scene(std::uint64_t seed, double pixel_noise, double position_noise_m, double rotation_noise) {
    Pcg32 random(seed);
    const Board board{9, 6, 0.02};
    std::vector<BoardPose> poses;
    for (int i = 0; i < kPoses; ++i) {
      const RigidTransform projector_from_board = turned(
          {0.5 * std::sin(2.1 * i), 0.5 * std::cos(1.7 * i), 0.3 * std::sin(1.1 * i)},
          {-0.08 + 0.02 * std::sin(3.0 * i), -0.05 + 0.02 * std::cos(2.0 * i), 1.1 + 0.02 * i});
      View view{"pose", board.corners(), {}, {}};
      for (const Eigen::Vector3d& x : view.x_in_object) {
        view.camera.emplace_back(0, 0);
        view.projector.emplace_back(lens.project(projector_from_board * x) +
                                    pixel_noise *
                                        Eigen::Vector2d(random.normal(), random.normal()));
      }
      tracking::SynchronisedPose sensor;
      sensor.world_from_body =
          world_from_projector * projector_from_board * board_from_sensor *
          turned(normals(random, rotation_noise), normals(random, position_noise_m));
      sensor.position_deviation_m = position_noise_m;
      sensor.rotation_deviation_rad = rotation_noise;
      // What a fit of the board's pose would give: good across the line of sight, worse along it.
      RigidTransform seen = projector_from_board;
      seen.translation.z() += (pixel_noise > 0 ? 5e-4 : 0) * random.normal();
      seen.rotation =
          seen.rotation * turned(normals(random, pixel_noise > 0 ? 5e-4 : 0), {0, 0, 0}).rotation;
      views.push_back(std::move(view));
      sensors.push_back(sensor);
      poses.push_back({"pose", seen, sensor});
    }
    auto registered = register_boards(poses);
    if (!registered) ADD_FAILURE() << registered.error().what;
    VENEER_CHECK(registered.has_value());
    start = std::move(*registered);
  }

  /// Cross-hairs on something uneven where the scene is; each touched with this noise.
  [[nodiscard]] std::vector<PixelTouch> touches(std::uint64_t seed, double noise_m) const {
    Pcg32 random(seed, 1);
    std::vector<PixelTouch> list;
    for (int i = 0; i < 12; ++i) {
      const Eigen::Vector3d in_projector(
          -0.1 + 0.06 * (i % 4), -0.08 + 0.08 * (i / 4), 1.15 + 0.01 * (i % 5));
      list.push_back({lens.project(in_projector),
                      world_from_projector * in_projector + normals(random, noise_m),
                      std::max(noise_m, 1e-6)});
    }
    return list;
  }

  /// Largest distance, in pixels, between where truth and `found` put points of the scene.
  [[nodiscard]] double off_px(const RigidTransform& found) const {
    double most = 0;
    for (const double x : {-0.1, 0.1}) {
      for (const double y : {-0.1, 0.1}) {
        const Eigen::Vector3d in_world = world_from_projector * Eigen::Vector3d(x, y, 1.2);
        most = std::max(most,
                        (lens.project(found.inverse() * in_world) -
                         lens.project(world_from_projector.inverse() * in_world))
                            .norm());
      }
    }
    return most;
  }
};

TEST(TieRegistration, IsExactWithoutNoise) {
  const Scene scene(1, 0, 0, 0);
  const auto tied = tie_registration(scene.views, scene.sensors, scene.lens, scene.start);
  ASSERT_TRUE(tied) << tied.error().what;
  EXPECT_LT(scene.off_px(tied->world_from_projector), 1e-6);
  EXPECT_LT(tied->rms_px, 1e-6);
  EXPECT_LT((tied->board_from_sensor.translation - scene.board_from_sensor.translation).norm(),
            1e-7);
}

TEST(TieRegistration, PutsThePictureBetterThanPosesAlone) {
  std::vector<double> before;
  std::vector<double> after;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const Scene scene(seed, 0.05, 2e-4, 3.5e-4);
    const auto tied = tie_registration(scene.views, scene.sensors, scene.lens, scene.start);
    ASSERT_TRUE(tied) << tied.error().what;
    before.push_back(scene.off_px(scene.start.world_from_projector));
    after.push_back(scene.off_px(tied->world_from_projector));
    // A pose that was held out has the tracker's whole noise, a third of a pixel, in it.
    EXPECT_LT(tied->held_out_px, 2.0) << seed;
    EXPECT_GT(tied->held_out_px, tied->rms_px) << seed;
    EXPECT_GT(tied->position_deviation_m, 0) << seed;
  }
  // Measured 0.64 px in place of 1.28.
  EXPECT_LT(mean(after), 0.8 * mean(before)) << mean(before) << " to " << mean(after);
}

TEST(TieRegistration, CrossHairsPutItWithinAPixel) {
  std::vector<double> off;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const Scene scene(seed, 0.05, 2e-4, 3.5e-4);
    std::vector<PixelTouch> touches = scene.touches(seed, 2e-4);
    touches[3].x_in_world.x() += 0.01;  // a hand that slipped
    const auto tied =
        tie_registration(scene.views, scene.sensors, scene.lens, scene.start, touches);
    ASSERT_TRUE(tied) << tied.error().what;
    off.push_back(scene.off_px(tied->world_from_projector));
    EXPECT_GT(tied->touch_rms_px, 0);
  }
  EXPECT_LT(quantile(off, 0.95), 1.0) << mean(off);
}

TEST(TieRegistration, LeavesOutliersOutAndRefusesWhatDoesNotFit) {
  Scene scene(3, 0.05, 2e-4, 3.5e-4);
  scene.start.inlier[2] = false;
  scene.sensors[2].world_from_body.translation.x() += 0.5;
  const auto tied = tie_registration(scene.views, scene.sensors, scene.lens, scene.start);
  ASSERT_TRUE(tied) << tied.error().what;
  EXPECT_LT(scene.off_px(tied->world_from_projector), 2.0);

  const std::span<const View> fewer(scene.views.data(), 7);
  EXPECT_FALSE(tie_registration(fewer, scene.sensors, scene.lens, scene.start));
  BoardRegistration three = scene.start;
  three.inlier.assign(kPoses, false);
  for (const std::size_t i : {0U, 1U, 3U}) three.inlier[i] = true;
  EXPECT_FALSE(tie_registration(scene.views, scene.sensors, scene.lens, three));
  for (const double deviation : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_FALSE(
        tie_registration(scene.views, scene.sensors, scene.lens, scene.start, {}, {deviation}));
  const PixelTouch nowhere{{std::nan(""), 0}, {0, 0, 0}, 1e-3};
  EXPECT_FALSE(tie_registration(
      scene.views, scene.sensors, scene.lens, scene.start, std::span(&nowhere, 1)));
  // A projector on the other side sees nothing of it.
  BoardRegistration behind = scene.start;
  behind.world_from_projector = behind.world_from_projector * turned({0, EIGEN_PI, 0}, {0, 0, 0});
  const auto nothing = tie_registration(scene.views, scene.sensors, scene.lens, behind);
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::geometry
