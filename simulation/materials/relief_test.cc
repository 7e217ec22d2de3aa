// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/relief.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "base/random.h"
#include "simulation/materials/internal_test_fields.h"

namespace veneer::simulation {
namespace {

// A rough field of independent heights: every patch is twisted.
HeightField rubble(int resolution, double height, std::uint64_t seed) {
  HeightField field = flat_field(resolution, white_lambert());
  Pcg32 random(seed);
  for (float& h : field.heights) h = static_cast<float>(height * random.uniform());
  return field;
}

double height_below(const Relief& relief, const Eigen::Vector3d& p) {
  const int n = relief.resolution();
  const double left = std::floor(p.x());
  const double up = std::floor(p.y());
  const int column = ((static_cast<int>(left) % n) + n) % n;
  const int row = ((static_cast<int>(up) % n) + n) % n;
  return relief.point(column, row, p.x() - left, p.y() - up).z;
}

TEST(Relief, IsHitWhereSmallStepsMeetIt) {
  constexpr double kStep =
      1e-3;  // cells; a ray may graze a patch by less and be missed by the steps
  const Relief relief(rubble(8, 0.4, 3));
  Pcg32 random(11);
  int misses = 0;
  for (int i = 0; i < 400; ++i) {
    const Eigen::Vector3d from(
        40.0 * random.uniform() - 20.0, 40.0 * random.uniform() - 20.0, relief.top() + 0.5);
    const Eigen::Vector3d along =
        Eigen::Vector3d(random.normal(), random.normal(), -0.3 - random.uniform()).normalized();
    const auto hit = relief.first_hit(from, along);
    ASSERT_TRUE(hit.has_value()) << from.transpose() << " along " << along.transpose();
    Eigen::Vector3d stepped = from;
    while (stepped.z() > height_below(relief, stepped)) stepped += kStep * along;
    EXPECT_NEAR(hit->z, relief.point(hit->column, hit->row, hit->u, hit->v).z, 1e-5);
    if (std::abs(stepped.z() - hit->z) > 2.0 * kStep) ++misses;
  }
  EXPECT_LE(misses, 4);  // grazes of less than a step: one in a hundred at most
}

TEST(Relief, IsPeriodic) {
  const Relief relief(rubble(8, 0.2, 5));
  const Eigen::Vector3d along = Eigen::Vector3d(0.5, -0.3, -0.6).normalized();
  const auto here = relief.first_hit({3.3, 4.1, 5.0}, along);
  const auto there = relief.first_hit({3.3 - 24.0, 4.1 + 16.0, 5.0}, along);
  ASSERT_TRUE(here && there);
  EXPECT_NEAR((relief.position(*here) - relief.position(*there)).norm(), 0.0, 1e-9);
}

TEST(Relief, LetsRaysLeaveUpwardsAndStopsThoseFromBelow) {
  const Relief relief(rubble(8, 0.2, 6));
  EXPECT_FALSE(relief.first_hit({1.5, 1.5, relief.top() + 0.1}, Eigen::Vector3d::UnitZ()));
  EXPECT_FALSE(relief.first_hit({1.5, 1.5, relief.top() + 0.1}, Eigen::Vector3d::UnitX()));
  EXPECT_TRUE(relief.first_hit({1.5, 1.5, relief.top() + 0.1}, -Eigen::Vector3d::UnitZ()));
  const auto below = relief.first_hit({1.5, 1.5, -5.0}, Eigen::Vector3d::UnitZ());
  ASSERT_TRUE(below.has_value());
  EXPECT_DOUBLE_EQ(below->z, -5.0);
}

TEST(Relief, GivesUpOnARayThatRunsLevelInAGroove) {
  const Relief relief(zigzag(16, 1, 1.0, white_lambert()));
  EXPECT_FALSE(relief.first_hit({8.0, 3.0, 0.0}, Eigen::Vector3d::UnitY()));
  EXPECT_TRUE(relief.first_hit({8.0, 3.0, 0.0}, Eigen::Vector3d::UnitX()));
}

TEST(Relief, HasItsReferencePlaneAtTheMeanHeight) {
  HeightField field = flat_field(4, white_lambert());
  for (float& h : field.heights) h = 0.7F;
  const Relief relief(field);
  const auto hit = relief.first_hit({1.2, 2.3, 9.0}, -Eigen::Vector3d::UnitZ());
  ASSERT_TRUE(hit.has_value());
  EXPECT_NEAR(hit->z, 0.0, 1e-6);
}

TEST(Relief, NormalsAreThoseOfThePatch) {
  const Relief relief(rubble(6, 0.3, 8));
  constexpr double kDelta = 1e-4;
  for (int cell = 0; cell < 36; ++cell) {
    const Relief::Hit hit = relief.point(cell % 6, cell / 6, 0.3, 0.8);
    const double dx = (relief.point(hit.column, hit.row, 0.3 + kDelta, 0.8).z - hit.z) / kDelta;
    const double dy = (relief.point(hit.column, hit.row, 0.3, 0.8 + kDelta).z - hit.z) / kDelta;
    const Eigen::Vector3d expected = Eigen::Vector3d(-dx, -dy, 1.0).normalized();
    // Float coefficients evaluated in double: the difference quotient of a bilinear patch is exact
    // but for float's rounding.
    EXPECT_NEAR((relief.normal(hit) - expected).norm(), 0.0, 1e-5) << cell;
  }
}

TEST(HeightField, RefusesWhatIsNoSurface) {
  const HeightField good = flat_field(4, white_lambert());
  ASSERT_TRUE(good.check().has_value());
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  HeightField bad = good;
  bad.heights[5] = kNan;
  EXPECT_FALSE(bad.check().has_value());
  bad = good;
  bad.heights.pop_back();
  EXPECT_FALSE(bad.check().has_value());
  bad = good;
  bad.surfaces[3].albedo[1] = 1.2F;
  EXPECT_FALSE(bad.check().has_value());
  bad = good;
  bad.surfaces[3].f0[2] = kNan;
  EXPECT_FALSE(bad.check().has_value());
  bad = good;
  bad.surfaces[0].alpha = 0.0F;
  EXPECT_FALSE(bad.check().has_value());
  bad = good;
  bad.tile_width_mm = 0.0;
  EXPECT_FALSE(bad.check().has_value());
  EXPECT_FALSE(HeightField{}.check().has_value());
}

}  // namespace
}  // namespace veneer::simulation
