// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/traced_mesh.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

Eigen::Vector3d random_direction(Pcg32& random) {
  return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}

TEST(TracedMesh, RaysToTheMiddleOfASphereEndOnIt) {
  const TracedMesh sphere(*load_mesh("sphere"));
  Pcg32 random(1);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector3d out = random_direction(random);
    const auto hit = sphere.trace(0.7 * out, -out);
    ASSERT_TRUE(hit) << out.transpose();
    const SurfacePoint point = sphere.at(*hit);
    // Facets lie within the sphere; half their size over the radius is at most a few degrees.
    EXPECT_NEAR(point.position.norm(), 0.1, 3e-4);
    EXPECT_GT(point.normal.dot(out), std::cos(0.02)) << out.transpose();
  }
}

TEST(TracedMesh, TangentsAreUnitSquareToTheNormalAndAlongU) {
  const TracedMesh sphere(*load_mesh("sphere"));
  Pcg32 random(2);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector3d out = random_direction(random);
    const SurfacePoint point = sphere.at(*sphere.trace(0.7 * out, -out));
    EXPECT_NEAR(point.tangent.norm(), 1, 1e-12);
    EXPECT_NEAR(point.tangent.dot(point.normal), 0, 1e-12);
    if (std::abs(out.y()) > 0.95) continue;  // near the poles u turns within a facet
    // u runs eastwards: along +x where the sphere faces +z.
    const Eigen::Vector3d east = Eigen::Vector3d::UnitY().cross(out).normalized();
    EXPECT_GT(point.tangent.dot(east), std::cos(0.05)) << out.transpose();
  }
}

TEST(TracedMesh, RaysPastItMeetNothing) {
  const TracedMesh sphere(*load_mesh("sphere"));
  EXPECT_FALSE(sphere.trace({0, 0.11, 1}, {0, 0, -1}));
  EXPECT_FALSE(sphere.trace({0, 0, 1}, {0, 0, 1})) << "away from it";
}

TEST(TracedMesh, HidesWhatLiesBehindItAndNothingElse) {
  const TracedMesh sphere(*load_mesh("sphere"));
  Pcg32 random(3);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector3d out = random_direction(random);
    const SurfacePoint point = sphere.at(*sphere.trace(0.7 * out, -out));
    const Eigen::Vector3d other = 2 * random_direction(random);
    const double height = point.normal.dot((other - point.position).normalized());
    if (std::abs(height) < 0.05) continue;  // along the facets
    EXPECT_EQ(sphere.hides(point, other), height < 0) << out.transpose();
  }
}

TEST(TracedMesh, ATextureWithoutExtentStillGivesAFrame) {
  Mesh mesh = testing::square(0.1);
  for (Eigen::Vector2d& uv : mesh.texture_coordinates) uv.setZero();
  const TracedMesh square(mesh);
  const SurfacePoint point = square.at({0, 0.2F, 0.2F});
  EXPECT_NEAR(point.tangent.norm(), 1, 1e-12);
  EXPECT_NEAR(point.tangent.dot(point.normal), 0, 1e-12);
}

}  // namespace
}  // namespace veneer::simulation
