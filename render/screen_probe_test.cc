// SPDX-License-Identifier: Apache-2.0
#include "render/screen_probe.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <vector>

#include "render/internal_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kWidth = 4;
constexpr int kHeight = 3;

double total(const std::vector<ScreenQuery::Share>& shares) {
  return std::accumulate(shares.begin(), shares.end(), 0.0, [](double sum, const auto& share) {
    return sum + share.part;
  });
}

TEST(SharesOf, OneRaySeesTheTexelAtTheCentreInAnyRepeat) {
  for (const double repeat : {-2.0, 0.0, 3.0}) {
    const auto shares = shares_of(Vector2d(repeat + 0.6, repeat + 0.4),
                                  Vector2d(0.5, 0),
                                  Vector2d(0, 0.5),
                                  kWidth,
                                  kHeight,
                                  1);
    ASSERT_EQ(shares.size(), 1U);
    EXPECT_EQ(shares[0].texel, 1 * kWidth + 2);
    EXPECT_EQ(shares[0].part, 1.0);
  }
}

TEST(SharesOf, APixelOfTheWholeSampleSeesEveryTexelAlike) {
  for (const Vector2d& at : {Vector2d(0.5, 0.5), Vector2d(-0.3, 7.9)}) {
    const auto shares = shares_of(at, Vector2d(1, 0), Vector2d(0, 1), kWidth, kHeight, 24);
    ASSERT_EQ(shares.size(), static_cast<std::size_t>(kWidth * kHeight));
    for (const auto& share : shares) EXPECT_NEAR(share.part, 1.0 / (kWidth * kHeight), 1.0 / 24);
    EXPECT_NEAR(total(shares), 1.0, 1e-12);
  }
}

TEST(SharesOf, APixelAcrossABorderSeesBothSides) {
  // A quarter of a texel before the border, one texel wide: a quarter beyond it.
  const auto shares = shares_of(Vector2d(0.25 - 0.25 / kWidth, 0.5),
                                Vector2d(1.0 / kWidth, 0),
                                Vector2d(0, 1e-6),
                                kWidth,
                                kHeight,
                                16);
  ASSERT_EQ(shares.size(), 2U);
  EXPECT_DOUBLE_EQ(shares[0].part, 0.75);
  EXPECT_DOUBLE_EQ(shares[1].part, 0.25);
}

TEST(SharesOf, APixelWithoutExtentSeesOneTexel) {
  const auto shares =
      shares_of(Vector2d(1.0, 1.0), Vector2d::Zero(), Vector2d::Zero(), kWidth, kHeight, 8);
  ASSERT_EQ(shares.size(), 1U);
  EXPECT_EQ(shares[0].texel, 0);
}

constexpr int kRasterWidth = 160;
constexpr int kRasterHeight = 120;

class ProbeTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto result = probe({}, {});
    if (!result && result.error().code == Errc::kUnavailable) GTEST_SKIP() << result.error().what;
  }
  Result<std::vector<ProbedScreen>> probe(const std::vector<FrameInput>& viewpoints,
                                          const ScreenProbeOptions& options) {
    return probe_scene(scene_, profile_, viewpoints, options);
  }
  static Scene lit_plate() {
    Scene scene;
    scene.mesh = *load_mesh("plate");
    scene.lights = {DirectionalLight{Vector3d(0.3, 0.5, 0.8).normalized(), {1, 2, 3}},
                    PointLight{{0.4, -0.3, 0.5}, {4, 5, 6}},
                    DirectionalLight{-Vector3d::UnitZ(), {7, 8, 9}}};
    return scene;
  }

  Scene scene_ = lit_plate();
  calibration::ProjectorProfile profile_ = example_profile(kRasterWidth, kRasterHeight, 8);
};

TEST_F(ProbeTest, FindsDirectionsLightAndGAsComputedByHandOnAPlate) {
  FrameInput input;
  input.eye_in_world = {-0.4, 0.3, 0.9};
  input.world_from_object.rotation =
      Eigen::AngleAxisd(0.3, Vector3d::UnitX()) * Eigen::AngleAxisd(-0.4, Vector3d::UnitY());
  input.world_from_object.translation = {0.02, -0.03, 0.05};
  const auto screens = probe({input}, {.width = 7, .height = 5, .pixels = 300, .rays = 1});
  ASSERT_TRUE(screens) << screens.error().what;
  const ProbedScreen& screen = screens->front();
  EXPECT_GT(screen.queries.size(), 200U);
  EXPECT_EQ(screen.queries.size() + static_cast<std::size_t>(screen.at_edges), 300U);
  const calibration::ProjectorGeometry& g = profile_.geometry;
  const RigidTransform object_from_world = input.world_from_object.inverse();
  const RigidTransform object_from_projector = object_from_world * g.world_from_projector;
  // What single precision leaves of coordinates and directions.
  constexpr double kRounding = 5e-6;
  for (const ScreenQuery& query : screen.queries) {
    const int raster_row = query.pixel / kRasterWidth;
    const Vector3d along =
        object_from_projector.rotation * Vector3d((query.pixel % kRasterWidth + 0.5 - g.cx) / g.fx,
                                                  (raster_row + 0.5 - g.cy) / g.fy,
                                                  1.0);
    const Vector3d& projector = object_from_projector.translation;
    const Vector3d point = projector - along * (projector.z() / along.z());
    // The plate's tangent is +x of the object and its normal +z: the local frame is the object's.
    ASSERT_EQ(query.shares.size(), 1U);
    const int column = static_cast<int>(7 * (point.x() / 0.2 + 0.5));
    const int row = static_cast<int>(5 * (0.5 - point.y() / 0.2));
    EXPECT_EQ(query.shares[0].texel, 7 * row + column);
    const Vector3d to_eye = object_from_world * input.eye_in_world - point;
    EXPECT_LT((query.view - to_eye.normalized()).norm(), kRounding);
    const Vector3d to_projector = projector - point;
    EXPECT_NEAR(query.geometry,
                to_projector.normalized().z() *
                    std::pow(profile_.reference_distance_m / to_projector.norm(), 2),
                kRounding);
    ASSERT_EQ(query.lights.size(), 3U);
    const Vector3d to_sun = object_from_world.rotation *
                            std::get<DirectionalLight>(scene_.lights[0]).direction_to_light;
    EXPECT_LT((query.lights[0].direction - to_sun).norm(), kRounding);
    EXPECT_LT((query.lights[0].rgb - Vector3d(1, 2, 3) / std::numbers::pi).norm(), kRounding);
    const Vector3d to_lamp =
        object_from_world * std::get<PointLight>(scene_.lights[1]).position - point;
    EXPECT_LT((query.lights[1].direction - to_lamp.normalized()).norm(), kRounding);
    EXPECT_LT((query.lights[1].rgb - Vector3d(4, 5, 6) / (std::numbers::pi * to_lamp.squaredNorm()))
                  .norm(),
              20 * kRounding);                       // of some 10 cd/m^2
    EXPECT_LT(query.lights[2].direction.z(), -0.5);  // from behind
  }
}

TEST_F(ProbeTest, LeavesOutSilhouettesAndSeams) {
  // Two plates of which one is above a part of the other, so that uv jumps within what is covered.
  const Mesh plate = scene_.mesh;
  const auto count = static_cast<std::uint32_t>(plate.positions.size());
  for (std::size_t i = 0; i < plate.positions.size(); ++i) {
    scene_.mesh.positions.push_back(0.5 * plate.positions[i] + Vector3d(0, 0, 0.1));
    scene_.mesh.normals.push_back(plate.normals[i]);
    scene_.mesh.texture_coordinates.push_back(plate.texture_coordinates[i]);
  }
  for (const auto& t : plate.triangles)
    scene_.mesh.triangles.push_back({t[0] + count, t[1] + count, t[2] + count});
  const std::vector<FrameInput> frontal{{{0, 0, 1}, {}}};
  const auto both = probe(frontal, {.pixels = 1'000'000, .rays = 2});
  ASSERT_TRUE(both) << both.error().what;
  scene_.mesh = plate;
  const auto one = probe(frontal, {.pixels = 1'000'000, .rays = 2});
  ASSERT_TRUE(one) << one.error().what;
  EXPECT_EQ(one->front().covered, both->front().covered);
  EXPECT_EQ(one->front().at_edges + static_cast<std::int64_t>(one->front().queries.size()),
            one->front().covered);
  // Of the plate, a pixel for each along its border, some 200; of the smaller one above it, half as
  // far around and one on both sides.
  const auto around = static_cast<double>(one->front().at_edges);
  EXPECT_NEAR(around, 4 * std::sqrt(static_cast<double>(one->front().covered)), 0.1 * around);
  EXPECT_NEAR(static_cast<double>(both->front().at_edges), 2.1 * around, 0.2 * around);
}

TEST_F(ProbeTest, SpreadsOverAllThatIsCovered) {
  const auto screens =
      probe({{{0, 0, 1}, {}}}, {.width = 2, .height = 2, .pixels = 200, .rays = 2});
  ASSERT_TRUE(screens) << screens.error().what;
  // A quarter of the plate is a quarter of the pixels, and each shows one texel of four.
  std::map<int, double> share;
  for (const ScreenQuery& query : screens->front().queries)
    for (const auto& [texel, part] : query.shares) share[texel] += part;
  ASSERT_EQ(share.size(), 4U);
  const auto total = static_cast<double>(screens->front().queries.size());
  for (const auto& [texel, pixels] : share) EXPECT_NEAR(pixels, total / 4, 0.05 * total);
}

TEST_F(ProbeTest, AnObjectOutOfSightAsksNothing) {
  FrameInput away{{0, 0, 1}, {}};
  away.world_from_object.translation = {50, 0, 0};
  const auto screens = probe({away}, {});
  ASSERT_TRUE(screens) << screens.error().what;
  EXPECT_EQ(screens->front().covered, 0);
  EXPECT_TRUE(screens->front().queries.empty());
}

TEST_F(ProbeTest, RefusesWhatCannotBeProbed) {
  EXPECT_EQ(probe({}, {.pixels = 0}).error().code, Errc::kInvalidOption);
  EXPECT_EQ(probe({}, {.rays = 0}).error().code, Errc::kInvalidOption);
  scene_.mesh.triangles.clear();
  EXPECT_EQ(probe({}, {}).error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::render
