// SPDX-License-Identifier: Apache-2.0
#include "quality/reach.h"

#include <gtest/gtest.h>

#include <numeric>

#include "btf/elevated_concentric.h"
#include "btf/spherical_interpolation.h"
#include "quality/internal_test_scenes.h"

namespace veneer::quality {
namespace {

using btf::DirectionBox;
using testing::front_projector;
using testing::place;
using testing::plate;

btf::SampleSetInfo bonn_set() {
  btf::SampleSetInfo info;
  info.width = info.height = 64;
  info.views = info.lights = btf::bonn_directions();
  return info;
}

Reach reach_of(const render::Scene& scene,
               const calibration::ProjectorProfile& profile = front_projector(),
               const ReachOptions& options = {}) {
  SilentProgress silent;
  auto reach = find_reach(scene, profile, bonn_set(), silent, options);
  if (!reach) throw std::runtime_error(reach.error().what);
  return *reach;
}

std::string refusal(const render::Scene& scene,
                    const calibration::ProjectorProfile& profile = front_projector(),
                    const ReachOptions& options = {}) {
  SilentProgress silent;
  const auto reach = find_reach(scene, profile, bonn_set(), silent, options);
  return reach ? "" : reach.error().what;
}

void expect_contains(const DirectionBox& outer, const DirectionBox& inner) {
  EXPECT_LE(outer.u_min, inner.u_min);
  EXPECT_GE(outer.u_max, inner.u_max);
  EXPECT_LE(outer.v_min, inner.v_min);
  EXPECT_GE(outer.v_max, inner.v_max);
}

// The plate's normal is +z, its columns run along +x and its rows along -y: the local frame is the
// world's.
TEST(Reach, OfAFlatPlateFarFromLightAndEyeIsOnePairOfDirections) {
  constexpr double kFar_m = 400;
  const render::Scene scene = plate(25, 25, kFar_m);
  const Reach reach = reach_of(scene);
  const btf::Direction view = place(25, 20);
  const btf::Direction light = place(0, 45);
  // From any point of it the eye is in the same direction, within its size over its distance.
  const double kTurn = 0.15 / kFar_m;
  for (const Asked& asked : reach.asked) {
    ASSERT_EQ(asked.lights, 1);
    EXPECT_LT((asked.view - view).norm(), 2 * kTurn);
    EXPECT_LT((asked.lit[0].light - light).norm(), 1e-12);
    EXPECT_TRUE(asked.lit[0].illuminance_rgb.isApprox(Eigen::Vector3d::Constant(300)));
  }
  for (const auto& [box, direction] :
       {std::pair{reach.region.views, view}, std::pair{reach.region.lights, light}}) {
    const Eigen::Vector2d st = btf::square_from_direction(direction);
    EXPECT_NEAR(box.u_min, st.x() - kLeastMargin, 2 * kTurn);
    EXPECT_NEAR(box.u_max, st.x() + kLeastMargin, 2 * kTurn);
    EXPECT_NEAR(box.v_min, st.y() - kLeastMargin, 2 * kTurn);
    EXPECT_NEAR(box.v_max, st.y() + kLeastMargin, 2 * kTurn);
  }
  // What the interpolation takes for that pair, and nothing else.
  const btf::SampleSetInfo set = bonn_set();
  const auto v = btf::SphericalInterpolator(set.views, btf::DirectionRole::kView).weights(view);
  const auto l = btf::SphericalInterpolator(set.lights, btf::DirectionRole::kLight).weights(light);
  std::vector<double> exact(static_cast<std::size_t>(set.pair_count()));
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      exact[static_cast<std::size_t>(v.index[i]) * set.lights.size() +
            static_cast<std::size_t>(l.index[j])] += v.weight[i] * l.weight[j];
  // Weights turn by about one for a step of 15 degrees between measured directions.
  const double kTolerance = 2 * kTurn / 0.2;
  for (std::size_t i = 0; i < exact.size(); ++i)
    EXPECT_NEAR(
        reach.region.weights.weight[i] / static_cast<double>(exact.size()), exact[i], kTolerance);
  EXPECT_LE(reach.reached_pairs * set.pair_count(), 9 + 1e-9);
  EXPECT_EQ(reach.below_horizon, 0);
  EXPECT_TRUE(reach.region.weights.check(set));
}

TEST(Reach, OfASphereAmongLightsAllAroundIsNearlyEverything) {
  render::Scene scene = testing::scene_of("sphere");
  scene.observer_region =
      render::Region{{0, 0, 0}, {0.5, 2}, {-std::numbers::pi, std::numbers::pi}, {-1.5, 1.5}};
  scene.lights = {render::DirectionalLight{}};
  scene.light_regions = {
      render::Region{{0, 0, 0}, {1, 1}, {-std::numbers::pi, std::numbers::pi}, {-1.5, 1.5}}};
  const Reach reach = reach_of(scene);
  EXPECT_GT(reach.reached_pairs, 0.99);
  EXPECT_TRUE(reach.region.views.is_all());
  EXPECT_TRUE(reach.region.lights.is_all());
  EXPECT_GT(reach.view_theta_max, 85 * testing::kDegree);
  // Half of all eyes and half of all lights are behind a point.
  EXPECT_NEAR(reach.below_horizon, 0.75, 0.03);
}

TEST(Reach, IsMirroredWithTheScene) {
  render::Scene scene = plate(10, 50, 0.6);
  scene.lights = {render::PointLight{{0.4, 0.5, 0.7}, {80, 80, 80}}};
  render::Scene mirrored = scene;
  mirrored.observer_region = testing::arc(-50, -10, 20, 0.6);
  mirrored.lights = {render::PointLight{{-0.4, 0.5, 0.7}, {80, 80, 80}}};
  const Reach right = reach_of(scene);
  const Reach left = reach_of(mirrored);
  for (const auto box : {&btf::FitRegion::views, &btf::FitRegion::lights}) {
    const DirectionBox& r = right.region.*box;
    const DirectionBox& l = left.region.*box;
    constexpr double kSampling = 0.01;
    EXPECT_NEAR(r.u_min, 1 - l.u_max, kSampling);
    EXPECT_NEAR(r.u_max, 1 - l.u_min, kSampling);
    EXPECT_NEAR(r.v_min, l.v_min, kSampling);
    EXPECT_NEAR(r.v_max, l.v_max, kSampling);
  }
  EXPECT_NEAR(right.view_theta_max, left.view_theta_max, 0.02);
  // How often each view is asked, against its mirror image. Triangles that tie are split in one
  // way only, so only what both splits share is alike: sums over a ring of theta.
  const btf::SampleSetInfo set = bonn_set();
  std::array<double, 6> rings_right{};
  std::array<double, 6> rings_left{};
  for (std::size_t v = 0; v < set.views.size(); ++v) {
    const auto ring = static_cast<std::size_t>(
        std::lround(btf::angles_from_direction(set.views[v]).theta / (15 * testing::kDegree)));
    for (std::size_t l = 0; l < set.lights.size(); ++l) {
      rings_right[ring] += right.region.weights.weight[v * set.lights.size() + l];
      rings_left[ring] += left.region.weights.weight[v * set.lights.size() + l];
    }
  }
  for (std::size_t i = 0; i < rings_right.size(); ++i)
    EXPECT_NEAR(rings_right[i], rings_left[i], 0.01 * set.pair_count()) << i;
}

TEST(Reach, GrowsWithTheRegions) {
  const Reach small = reach_of(plate(-10, 10, 0.8));
  const Reach wide = reach_of(plate(-40, 40, 0.8));
  render::Scene moving = plate(-40, 40, 0.8);
  moving.light_regions = {testing::arc(-60, 60, 45, 1)};
  const Reach lit = reach_of(moving);
  for (const auto& [outer, inner] : {std::pair{&wide, &small}, std::pair{&lit, &wide}}) {
    expect_contains(outer->region.views, inner->region.views);
    expect_contains(outer->region.lights, inner->region.lights);
    EXPECT_GT(outer->reached_pairs, inner->reached_pairs);
    for (std::size_t i = 0; i < inner->region.weights.weight.size(); ++i) {
      if (inner->region.weights.weight[i] > 0.1F) {
        EXPECT_GT(outer->region.weights.weight[i], 0.0F) << i;
      }
    }
  }
}

TEST(Reach, ConvergesWithItsSamples) {
  const render::Scene scene = plate(-30, 30, 0.7);
  ReachOptions few;
  few.samples = std::size_t{1} << 14U;
  const Reach coarse = reach_of(scene, front_projector(), few);
  const Reach fine = reach_of(scene);
  double difference = 0;
  const auto& weights = fine.region.weights.weight;
  for (std::size_t i = 0; i < weights.size(); ++i)
    difference += std::abs(weights[i] - coarse.region.weights.weight[i]);
  // Of two densities that share nothing it would be 2.
  EXPECT_LT(difference / static_cast<double>(weights.size()), 0.02);
  EXPECT_NEAR(coarse.view_theta_max, fine.view_theta_max, 0.02);
  EXPECT_EQ(reach_of(scene).region.weights.weight, weights);
}

TEST(Reach, SumsTheWeightsToOneForEachPair) {
  const Reach reach = reach_of(plate(-30, 30, 0.7));
  const auto& weights = reach.region.weights.weight;
  EXPECT_NEAR(
      std::accumulate(weights.begin(), weights.end(), 0.0) / static_cast<double>(weights.size()),
      1.0,
      1e-5);
}

// Pixels of 1 / 600 m at 1 m, a texel of 0.2 m / 64.
TEST(Reach, KnowsTheTexelsUnderAPixel) {
  render::Scene scene = plate(0, 0, 1);
  const double kTexels = 64 / 0.2 / 600;
  const Reach once = reach_of(scene);
  EXPECT_NEAR(once.texels_per_pixel_median, kTexels, 1e-3 * kTexels);
  EXPECT_NEAR(once.texels_per_pixel_p95, kTexels, 1e-3 * kTexels);
  scene.texture_repeats = {8, 2};
  EXPECT_NEAR(reach_of(scene).texels_per_pixel_median, 4 * kTexels, 4e-3 * kTexels);
}

// Two plates, one behind the other and turned by 60 degrees about y: what it hides is not asked.
TEST(Reach, LeavesOutWhatTheObjectHidesFromTheProjector) {
  render::Scene scene = plate(0, 0, 300);
  Mesh behind = scene.mesh;
  const Eigen::AngleAxisd turn(60 * testing::kDegree, Eigen::Vector3d::UnitY());
  const auto first = static_cast<std::uint32_t>(scene.mesh.positions.size());
  for (std::size_t i = 0; i < behind.positions.size(); ++i) {
    scene.mesh.positions.push_back(turn * behind.positions[i] - 0.3 * Eigen::Vector3d::UnitZ());
    scene.mesh.normals.push_back(turn * behind.normals[i]);
    scene.mesh.texture_coordinates.push_back(behind.texture_coordinates[i]);
  }
  const auto front = scene.mesh.triangles;
  for (auto triangle : behind.triangles) {
    for (auto& corner : triangle) corner += first;
    scene.mesh.triangles.push_back(triangle);
  }
  const Reach hidden = reach_of(scene);
  EXPECT_LT(hidden.view_theta_max, 30 * testing::kDegree);
  scene.mesh.triangles.erase(scene.mesh.triangles.begin(),
                             scene.mesh.triangles.begin() + static_cast<int>(front.size()));
  EXPECT_GT(reach_of(scene).view_theta_max, 50 * testing::kDegree);
}

TEST(Reach, OfATrackedObjectIsEverything) {
  render::Scene scene = plate(-30, 30, 0.7);
  scene.object_body = 1;
  const Reach reach = reach_of(scene);
  EXPECT_TRUE(reach.any_pose);
  EXPECT_TRUE(reach.region.views.is_all());
  EXPECT_TRUE(reach.region.lights.is_all());
  EXPECT_EQ(reach.reached_pairs, 1);
  EXPECT_FALSE(reach.asked.empty());
  EXPECT_TRUE(reach.region.weights.check(bonn_set()));
}

TEST(Reach, RefusesScenesOfWhichNothingFollows) {
  render::Scene scene = plate(-30, 30, 0.7);
  render::Scene blind = scene;
  blind.observer_region.reset();
  EXPECT_NE(refusal(blind).find("[observer.region]"), std::string::npos);
  render::Scene away = scene;
  away.world_from_object.translation = {5, 0, 0};
  EXPECT_NE(refusal(away).find("lights nothing of the object"), std::string::npos);
  render::Scene behind = scene;
  behind.world_from_object.translation = {0, 0, 3};
  EXPECT_NE(refusal(behind).find("lights nothing of the object"), std::string::npos);
  render::Scene turned = scene;
  turned.world_from_object.rotation = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY());
  EXPECT_NE(refusal(turned).find("lights nothing of the object"), std::string::npos);
  render::Scene backlit = scene;
  backlit.lights = {render::DirectionalLight{{0, 0, -1}, {300, 300, 300}}};
  EXPECT_NE(refusal(backlit).find("behind the surface"), std::string::npos);
  render::Scene dark = scene;
  dark.lights = {render::DirectionalLight{{0, 0, 1}, {0, 0, 0}}};
  EXPECT_NE(refusal(dark).find("is off"), std::string::npos);
  EXPECT_NE(refusal(scene, front_projector(), {.samples = 10}).find("10 samples"),
            std::string::npos);
  EXPECT_NE(refusal(scene, front_projector(), {.kept = 0}).find("0 of"), std::string::npos);
  EXPECT_NE(refusal(scene, front_projector(), {.geometry_floor = NAN}).find("floor"),
            std::string::npos);
}

}  // namespace
}  // namespace veneer::quality
