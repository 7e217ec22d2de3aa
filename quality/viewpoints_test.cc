// SPDX-License-Identifier: Apache-2.0
#include "quality/viewpoints.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace veneer::quality {
namespace {

render::Scene ring() {
  render::Scene scene;
  scene.observer_region = render::Region{
      {0.1, 0.2, 0.3}, {0.5, 1.5}, {-std::numbers::pi / 6, std::numbers::pi / 3}, {0.1, 0.4}};
  return scene;
}

TEST(Viewpoints, LieInTheRegionAndFillEachQuarterOfIt) {
  const render::Scene scene = ring();
  const auto points = viewpoints_of(scene, 64);
  ASSERT_TRUE(points) << points.error().what;
  std::array<int, 4> quarters{};
  for (const Viewpoint& point : *points) {
    const Eigen::Vector3d from = point.eye_in_world - scene.observer_region->centre;
    const double azimuth = std::atan2(from.x(), from.z());
    const double elevation = std::asin(from.y() / from.norm());
    constexpr double kRounding = 1e-12;
    EXPECT_GE(from.norm(), 0.5 - kRounding);
    EXPECT_LE(from.norm(), 1.5 + kRounding);
    EXPECT_GE(azimuth, -std::numbers::pi / 6 - kRounding);
    EXPECT_LE(azimuth, std::numbers::pi / 3 + kRounding);
    EXPECT_GE(elevation, 0.1 - kRounding);
    EXPECT_LE(elevation, 0.4 + kRounding);
    const std::size_t right = azimuth > std::numbers::pi / 12 ? 1 : 0;
    const std::size_t far = from.norm() > 1.0 ? 2 : 0;
    ++quarters[right + far];
  }
  for (const int count : quarters) EXPECT_NEAR(count, 16, 4);
}

TEST(Viewpoints, SayWhatASceneWithoutARegionLacks) {
  const auto points = viewpoints_of(render::Scene{}, 4);
  ASSERT_FALSE(points);
  EXPECT_NE(points.error().what.find("[observer.region]"), std::string::npos);
  EXPECT_FALSE(viewpoints_of(ring(), 0));
}

}  // namespace
}  // namespace veneer::quality
