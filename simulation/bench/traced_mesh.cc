// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/traced_mesh.h"

#include <Eigen/Geometry>
#include <embree3/rtcore.h>

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "base/result.h"

namespace veneer::simulation {
namespace {

/// Shadow rays start this far off the surface, so that they do not meet it again: ten times the
/// rounding of a float coordinate of 1 m.
constexpr double kOffset_m = 1e-6;

/// dP/du of every triangle, summed at its corners.
std::vector<Eigen::Vector3d> vertex_tangents(const Mesh& mesh) {
  std::vector<Eigen::Vector3d> tangents(mesh.positions.size(), Eigen::Vector3d::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d side1 = mesh.positions[b] - mesh.positions[a];
    const Eigen::Vector3d side2 = mesh.positions[c] - mesh.positions[a];
    const Eigen::Vector2d uv1 = mesh.texture_coordinates[b] - mesh.texture_coordinates[a];
    const Eigen::Vector2d uv2 = mesh.texture_coordinates[c] - mesh.texture_coordinates[a];
    const double area = uv1.x() * uv2.y() - uv1.y() * uv2.x();
    if (area == 0) continue;  // no direction of u on it; its neighbours know
    const Eigen::Vector3d tangent = ((uv2.y() * side1 - uv1.y() * side2) / area).normalized();
    for (const std::uint32_t corner : {a, b, c}) tangents[corner] += tangent;
  }
  return tangents;
}

}  // namespace

struct TracedMesh::Scene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  explicit Scene(const Mesh& mesh) : device(rtcNewDevice("threads=1")) {
    VENEER_CHECK(device != nullptr);
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* positions = static_cast<float*>(rtcSetNewGeometryBuffer(geometry,
                                                                  RTC_BUFFER_TYPE_VERTEX,
                                                                  0,
                                                                  RTC_FORMAT_FLOAT3,
                                                                  3 * sizeof(float),
                                                                  mesh.positions.size()));
    for (const Eigen::Vector3d& position : mesh.positions)
      for (const double coordinate : position) *positions++ = static_cast<float>(coordinate);
    auto* corners = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(geometry,
                                                                        RTC_BUFFER_TYPE_INDEX,
                                                                        0,
                                                                        RTC_FORMAT_UINT3,
                                                                        3 * sizeof(std::uint32_t),
                                                                        mesh.triangles.size()));
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t corner : triangle) *corners++ = corner;
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  ~Scene() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
};

namespace {

RTCRay make_ray(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float far) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tfar = far;
  ray.mask = ~0U;
  return ray;
}

}  // namespace

TracedMesh::TracedMesh(Mesh mesh)
    : mesh_(std::move(mesh)),
      tangents_(vertex_tangents(mesh_)),
      scene_(std::make_unique<Scene>(mesh_)) {}
TracedMesh::~TracedMesh() = default;
TracedMesh::TracedMesh(TracedMesh&&) noexcept = default;

std::optional<MeshPoint> TracedMesh::trace(const Eigen::Vector3d& origin,
                                           const Eigen::Vector3d& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{};
  query.ray = make_ray(origin, direction, std::numeric_limits<float>::infinity());
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return MeshPoint{query.hit.primID, query.hit.u, query.hit.v};
}

bool TracedMesh::hides(const SurfacePoint& from, const Eigen::Vector3d& to) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  const Eigen::Vector3d start = from.position + kOffset_m * from.normal;
  RTCRay ray = make_ray(start, to - start, 1.0F);
  rtcOccluded1(scene_->scene, &context, &ray);
  return ray.tfar < 0;  // how Embree says that something is in the way
}

SurfacePoint TracedMesh::at(const MeshPoint& point) const {
  const auto& [a, b, c] = mesh_.triangles[point.triangle];
  const double u = point.u;
  const double v = point.v;
  const double w = 1.0 - u - v;
  SurfacePoint s;
  s.position = w * mesh_.positions[a] + u * mesh_.positions[b] + v * mesh_.positions[c];
  s.normal = (w * mesh_.normals[a] + u * mesh_.normals[b] + v * mesh_.normals[c]).normalized();
  s.uv = w * mesh_.texture_coordinates[a] + u * mesh_.texture_coordinates[b] +
         v * mesh_.texture_coordinates[c];
  const Eigen::Vector3d tangent = w * tangents_[a] + u * tangents_[b] + v * tangents_[c];
  const Eigen::Vector3d square = tangent - tangent.dot(s.normal) * s.normal;
  // Where u has no direction (a pole, a degenerate map) any tangent serves.
  constexpr double kLeastLength = 1e-9;
  s.tangent = square.norm() > kLeastLength ? square.normalized() : s.normal.unitOrthogonal();
  return s;
}

}  // namespace veneer::simulation
