// SPDX-License-Identifier: Apache-2.0
#include "render/texel_size.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace veneer::render {
namespace {

constexpr double kRounding = 1e-9;

TEST(TexelSizes, AreThePlatesSideOverItsTexels) {
  const auto size = texel_size_on(*load_mesh("plate"), {2, 2}, {16, 16});
  ASSERT_TRUE(size) << size.error().what;
  for (const double side : {size->mean_m, size->low_m, size->high_m})
    EXPECT_NEAR(side, 0.2 / 32, kRounding);
}

// A texel that is wider than high counts as a square of its area, and mirrored ones as any other.
TEST(TexelSizes, AreThoseOfSquaresOfTheSameArea) {
  const auto size = texel_size_on(*load_mesh("plate"), {-8, 2}, {4, 4});
  ASSERT_TRUE(size) << size.error().what;
  EXPECT_NEAR(size->mean_m, std::sqrt((0.2 / 32) * (0.2 / 8)), kRounding);
}

// Of a sphere in latitude and longitude a texel's area falls with the cosine of latitude: over
// height, which is even in area, its square root's quantiles are (1 - z^2)^(1/4) at |z| of 0.95 and
// 0.05; its mean is the sphere's area over its texels. Triangles are flat and as high as a row.
TEST(TexelSizes, SpreadOverASphere) {
  const auto size = texel_size_on(*load_mesh("sphere"), {6, 3}, {8, 8});
  ASSERT_TRUE(size) << size.error().what;
  const double texels = 6 * 3 * 64;
  const double at_equator = std::sqrt(2 * std::numbers::pi * std::numbers::pi * 0.01 / texels);
  EXPECT_NEAR(size->mean_m / std::sqrt(4 * std::numbers::pi * 0.01 / texels), 1.0, 0.01);
  EXPECT_NEAR(size->low_m / at_equator, std::pow(1 - 0.95 * 0.95, 0.25), 0.05);
  EXPECT_NEAR(size->high_m / at_equator, std::pow(1 - 0.05 * 0.05, 0.25), 0.01);
}

TEST(TexelSizes, NeedTexelsOnTheObject) {
  Mesh mesh = *load_mesh("plate");
  for (const double repeats : {0.0, std::numeric_limits<double>::quiet_NaN()}) {
    const auto size = texel_size_on(mesh, {repeats, 1}, {8, 8});
    ASSERT_FALSE(size);
    EXPECT_EQ(size.error().code, Errc::kInvalidOption);
    EXPECT_NE(size.error().what.find("texture_repeats"), std::string::npos) << size.error().what;
  }
  for (Eigen::Vector2d& uv : mesh.texture_coordinates) uv.y() = uv.x();
  const auto size = texel_size_on(mesh, {1, 1}, {8, 8});
  ASSERT_FALSE(size);
  EXPECT_EQ(size.error().code, Errc::kBadFormat);
  EXPECT_NE(size.error().what.find("unwrap"), std::string::npos) << size.error().what;
}

}  // namespace
}  // namespace veneer::render
