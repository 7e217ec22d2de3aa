// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/mesh.h"

namespace veneer::simulation {

/// A point of a mesh: a triangle and the barycentric weights of its second and third corner.
struct MeshPoint {
  std::uint32_t triangle = 0;
  float u = 0;
  float v = 0;
};

/// What a point of the surface is like, in the object's frame.
struct SurfacePoint {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;   ///< interpolated between the corners, unit length
  Eigen::Vector3d tangent;  ///< dP/du, averaged at the corners, interpolated, square to the normal
  Eigen::Vector2d uv;
};

/// The object's mesh with what rays need. Thread-safe after construction.
class TracedMesh {
 public:
  explicit TracedMesh(Mesh mesh);
  ~TracedMesh();
  TracedMesh(TracedMesh&&) noexcept;

  /// The first point that a ray meets.   @param direction  any length.
  [[nodiscard]] std::optional<MeshPoint> trace(const Eigen::Vector3d& origin,
                                               const Eigen::Vector3d& direction) const;
  /// Whether the mesh stands between a surface point and another point.
  [[nodiscard]] bool hides(const SurfacePoint& from, const Eigen::Vector3d& to) const;
  [[nodiscard]] SurfacePoint at(const MeshPoint& point) const;
  [[nodiscard]] const Mesh& mesh() const { return mesh_; }

 private:
  struct Scene;
  Mesh mesh_;
  std::vector<Eigen::Vector3d> tangents_;  // per vertex
  std::unique_ptr<Scene> scene_;
};

}  // namespace veneer::simulation
