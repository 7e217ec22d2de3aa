// SPDX-License-Identifier: Apache-2.0
#include "render/tangents.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>

namespace veneer::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

TEST(VertexTangents, AreUnitAndOrthogonalToTheNormalOnEveryBuiltInMesh) {
  for (const char* name : {"plate", "sphere", "vase"}) {
    const Mesh mesh = *load_mesh(name);
    const auto tangents = vertex_tangents(mesh);
    ASSERT_EQ(tangents.size(), mesh.positions.size());
    for (std::size_t i = 0; i < tangents.size(); ++i) {
      EXPECT_NEAR(tangents[i].norm(), 1.0, 1e-9) << name << " " << i;
      EXPECT_NEAR(tangents[i].dot(mesh.normals[i]), 0.0, 1e-9) << name << " " << i;
    }
  }
}

TEST(VertexTangents, RunAlongGrowingUSoThatYRunsToSmallerV) {
  const Mesh mesh = *load_mesh("sphere");
  const auto tangents = vertex_tangents(mesh);
  for (std::size_t i = 0; i < tangents.size(); ++i) {
    const Vector3d& n = mesh.normals[i];
    if (std::abs(n.y()) > 0.95)
      continue;  // near the poles the rings are too short for the law below
    // +u runs along +x where the sphere faces +z, that is, with the azimuth about y.
    const Vector3d along_u = Vector3d::UnitY().cross(n).normalized();
    // The chord over one of 128 segments leans from the tangent by up to pi/128 at the open seam.
    EXPECT_GT(tangents[i].dot(along_u), std::cos(0.03)) << n.transpose();
    // v grows downwards, y of the local frame upwards.
    EXPECT_GT(n.cross(tangents[i]).y(), 0.0);
  }
}

Mesh one_triangle(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, Vector3d::UnitZ());
  mesh.texture_coordinates = {a, b, c};
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

TEST(VertexTangents, FollowARotatedMappingAndAMirroredOne) {
  const Mesh turned = one_triangle({0, 0}, {0, 1}, {1, 0});  // u along y
  EXPECT_LT((vertex_tangents(turned)[0] - Vector3d::UnitY()).norm(), 1e-12);
  const Mesh mirrored = one_triangle({0, 0}, {-1, 0}, {0, -1});
  EXPECT_LT((vertex_tangents(mirrored)[0] + Vector3d::UnitX()).norm(), 1e-12);
}

TEST(VertexTangents, FallBackToTheMeshsAxesWhereTheMappingIsDegenerate) {
  const Mesh flat = one_triangle({0.5, 0.5}, {0.5, 0.5}, {0.5, 0.5});
  EXPECT_LT((vertex_tangents(flat)[1] - Vector3d::UnitX()).norm(), 1e-12);
  Mesh along_x = one_triangle({0, 0}, {1, 1}, {2, 2});
  along_x.normals.assign(3, Vector3d::UnitX());
  EXPECT_LT((vertex_tangents(along_x)[0] - Vector3d::UnitY()).norm(), 1e-12);
  // Two triangles that pull in opposite directions cancel.
  Mesh opposed = one_triangle({0, 0}, {1, 0}, {0, -1});
  opposed.positions.push_back({0, -1, 0});
  opposed.normals.push_back(Vector3d::UnitZ());
  opposed.texture_coordinates.emplace_back(0, -1);
  opposed.positions.push_back({2, 0, 0});
  opposed.normals.push_back(Vector3d::UnitZ());
  opposed.texture_coordinates.emplace_back(-1, 0);
  opposed.triangles.push_back({0, 3, 4});
  EXPECT_LT((vertex_tangents(opposed)[0] - Vector3d::UnitX()).norm(), 1e-12);
}

}  // namespace
}  // namespace veneer::render
