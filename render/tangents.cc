// SPDX-License-Identifier: Apache-2.0
#include "render/tangents.h"

#include <Eigen/Geometry>

#include <cmath>

namespace veneer::render {
namespace {

// Twice the area in texture space over the squared longest edge there, below which a triangle
// counts as degenerate: texture coordinates are read as floats, whose differences carry about 1e-7.
constexpr double kDegenerateMapping = 1e-6;
// A sum of tangents shorter than this part of its summands' length, or a projection shorter than
// this part of the vector, has no direction left to trust.
constexpr double kCancelled = 1e-3;

Eigen::Vector3d any_tangent(const Eigen::Vector3d& normal) {
  // cos(25 degrees) is about 0.9: further off, the projection of x keeps at least 0.4 of its
  // length.
  const Eigen::Vector3d axis =
      std::abs(normal.x()) < 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  return (axis - normal.dot(axis) * normal).normalized();
}

}  // namespace

std::vector<Eigen::Vector3d> vertex_tangents(const Mesh& mesh) {
  std::vector<Eigen::Vector3d> sums(mesh.positions.size(), Eigen::Vector3d::Zero());
  std::vector<double> weights(mesh.positions.size(), 0.0);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d ab = mesh.positions[b] - mesh.positions[a];
    const Eigen::Vector3d ac = mesh.positions[c] - mesh.positions[a];
    const Eigen::Vector2d uv_ab = mesh.texture_coordinates[b] - mesh.texture_coordinates[a];
    const Eigen::Vector2d uv_ac = mesh.texture_coordinates[c] - mesh.texture_coordinates[a];
    const double determinant = uv_ab.x() * uv_ac.y() - uv_ac.x() * uv_ab.y();
    const double longest = std::max(uv_ab.squaredNorm(), uv_ac.squaredNorm());
    if (!(std::abs(determinant) > kDegenerateMapping * longest)) continue;
    // P(u, v) is affine on the triangle; solving for its derivative in u gives this over det.
    const Eigen::Vector3d along_u =
        (uv_ac.y() * ab - uv_ab.y() * ac) * std::copysign(1.0, determinant);
    const double length = along_u.norm();
    const double area = ab.cross(ac).norm();
    if (!(length > 0.0) || !(area > 0.0)) continue;
    for (const auto vertex : {a, b, c}) {
      sums[vertex] += along_u * (area / length);
      weights[vertex] += area;
    }
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const Eigen::Vector3d& normal = mesh.normals[i];
    const double length = sums[i].norm();
    const Eigen::Vector3d projected = sums[i] - normal.dot(sums[i]) * normal;
    const bool trusted = length > kCancelled * weights[i] && projected.norm() > kCancelled * length;
    sums[i] = trusted ? Eigen::Vector3d(projected.normalized()) : any_tangent(normal);
  }
  return sums;
}

}  // namespace veneer::render
