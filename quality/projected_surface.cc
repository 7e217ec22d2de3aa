// SPDX-License-Identifier: Apache-2.0
#include "quality/projected_surface.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "render/tangents.h"

namespace veneer::quality {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Cells along the raster's longer side when it is asked what hides what. Coarser than pixels: a
// wrong answer at an edge moves the reach by the object's own directions next to it.
constexpr double kMostCells = 512;
// Nearer than this nothing is drawn.
constexpr double kNearest_m = 1e-4;
// Cells on the edge between two triangles belong to both, whatever was rounded.
constexpr double kEdge = 1e-6;

Vector2d pixel_of(const calibration::ProjectorGeometry& g, const Vector3d& in_projector) {
  return {g.fx * in_projector.x() / in_projector.z() + g.cx,
          g.fy * in_projector.y() / in_projector.z() + g.cy};
}

}  // namespace

ProjectedSurface::ProjectedSurface(const render::Scene& scene,
                                   const calibration::ProjectorProfile& profile)
    : profile_(profile), projector_from_world_(profile.geometry.world_from_projector.inverse()) {
  const Mesh& mesh = scene.mesh;
  const std::vector<Vector3d> tangents = render::vertex_tangents(mesh);
  const RigidTransform& place = scene.world_from_object;
  double area = 0;
  for (const auto& indices : mesh.triangles) {
    Triangle triangle;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t v = indices[i];
      triangle.corners[i] = {place * mesh.positions[v],
                             place.rotation * mesh.normals[v],
                             place.rotation * tangents[v],
                             mesh.texture_coordinates[v].cwiseProduct(scene.texture_repeats)};
    }
    const auto& c = triangle.corners;
    const double own =
        0.5 * (c[1].position - c[0].position).cross(c[2].position - c[0].position).norm();
    if (!(own > 0.0)) continue;
    triangle.area_up_to_here = area += own;
    triangles_.push_back(triangle);
  }
  draw_depths();
}

void ProjectedSurface::draw_depths() {
  const calibration::ProjectorGeometry& g = profile_.geometry;
  cells_per_pixel_ = std::min(1.0, kMostCells / std::max(g.width, g.height));
  depths_ = Image<float>(std::max(1, static_cast<int>(std::ceil(g.width * cells_per_pixel_))),
                         std::max(1, static_cast<int>(std::ceil(g.height * cells_per_pixel_))),
                         std::numeric_limits<float>::infinity());
  for (const Triangle& triangle : triangles_) {
    std::array<Vector2d, 3> at;
    Vector3d inverse_z;
    bool in_front = true;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d p = projector_from_world_ * triangle.corners[i].position;
      in_front = in_front && p.z() > kNearest_m;
      if (!in_front) break;
      at[i] = pixel_of(g, p) * cells_per_pixel_;
      inverse_z[static_cast<Eigen::Index>(i)] = 1.0 / p.z();
    }
    if (!in_front) continue;
    Eigen::Matrix3d corners;
    for (std::size_t i = 0; i < 3; ++i)
      corners.col(static_cast<Eigen::Index>(i)) = at[i].homogeneous();
    if (!(std::abs(corners.determinant()) > 1e-9)) continue;  // seen edge on
    const Eigen::Matrix3d weights_from_cell = corners.inverse();
    const auto range = [&](int axis, int most) {
      const auto [low, high] = std::minmax({at[0][axis], at[1][axis], at[2][axis]});
      return std::pair{static_cast<int>(std::clamp(std::floor(low), 0.0, double(most))),
                       static_cast<int>(std::clamp(std::ceil(high), 0.0, double(most)))};
    };
    const auto [left, right] = range(0, depths_.width());
    const auto [top, bottom] = range(1, depths_.height());
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) {
        const Vector3d weights = weights_from_cell * Vector3d(x + 0.5, y + 0.5, 1.0);
        if (weights.minCoeff() < -kEdge) continue;
        // 1 / z is linear over the raster.
        const auto z = static_cast<float>(1.0 / weights.dot(inverse_z));
        depths_(x, y) = std::min(depths_(x, y), z);
      }
    }
  }
}

bool ProjectedSurface::is_hidden(const Vector3d& in_projector, double cos_theta) const {
  const calibration::ProjectorGeometry& g = profile_.geometry;
  const Vector2d cell = pixel_of(g, in_projector) * cells_per_pixel_;
  const int x = std::clamp(static_cast<int>(cell.x()), 0, depths_.width() - 1);
  const int y = std::clamp(static_cast<int>(cell.y()), 0, depths_.height() - 1);
  // Within a cell the surface itself recedes by this much, and half as much again where it bends.
  const double cell_m = in_projector.z() / (std::min(g.fx, g.fy) * cells_per_pixel_);
  const double slope = std::sqrt(std::max(0.0, 1.0 - cos_theta * cos_theta)) / cos_theta;
  return depths_(x, y) < in_projector.z() - 1.5 * cell_m * (slope + 1.0);
}

std::optional<SurfacePoint> ProjectedSurface::at(const Vector3d& at, double geometry_floor) const {
  if (triangles_.empty()) return std::nullopt;
  const double area = at.x() * triangles_.back().area_up_to_here;
  auto found = std::ranges::upper_bound(triangles_, area, {}, &Triangle::area_up_to_here);
  if (found == triangles_.end()) --found;
  // The root makes it even over the triangle (Turk 1990).
  const double root = std::sqrt(at.y());
  return point(*found, {1.0 - root, root * (1.0 - at.z()), root * at.z()}, geometry_floor);
}

std::optional<SurfacePoint> ProjectedSurface::corner(std::size_t corner,
                                                     double geometry_floor) const {
  return point(triangles_[corner / 3],
               Vector3d::Unit(static_cast<Eigen::Index>(corner % 3)),
               geometry_floor);
}

std::optional<SurfacePoint> ProjectedSurface::point(const Triangle& triangle,
                                                    const Vector3d& barycentric,
                                                    double geometry_floor) const {
  const auto& c = triangle.corners;
  const Vector3d& b = barycentric;
  const auto mixed = [&](auto Corner::*what) {
    return (b[0] * (c[0].*what) + b[1] * (c[1].*what) + b[2] * (c[2].*what)).eval();
  };
  SurfacePoint point;
  point.position = mixed(&Corner::position);
  point.repeats = mixed(&Corner::repeats);
  const calibration::ProjectorGeometry& g = profile_.geometry;
  const Vector3d in_projector = projector_from_world_ * point.position;
  if (!(in_projector.z() > kNearest_m)) return std::nullopt;
  point.pixel = pixel_of(g, in_projector);
  if (!(point.pixel.x() >= 0 && point.pixel.x() < g.width && point.pixel.y() >= 0 &&
        point.pixel.y() < g.height))
    return std::nullopt;
  const Vector3d z = mixed(&Corner::normal).normalized();
  const Vector3d tangent = mixed(&Corner::tangent);
  const Vector3d x = (tangent - tangent.dot(z) * z).normalized();
  if (!z.allFinite() || !x.allFinite()) return std::nullopt;
  point.local_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  const Vector3d to_projector = g.world_from_projector.translation - point.position;
  const double distance = to_projector.norm();
  const double cos_theta = z.dot(to_projector) / distance;
  const double nearness = profile_.reference_distance_m / distance;
  point.geometry = cos_theta * nearness * nearness;
  point.vignetting = profile_.vignetting_at(point.pixel);
  if (!(point.geometry * point.vignetting >= geometry_floor)) return std::nullopt;

  // How the raster moves with the place on the triangle, and how the texture does.
  const Vector3d e1 = c[1].position - c[0].position;
  const Vector3d e2 = c[2].position - c[0].position;
  Eigen::Matrix<double, 2, 3> pixel_from_move;
  pixel_from_move << g.fx, 0, -g.fx * in_projector.x() / in_projector.z(),  //
      0, g.fy, -g.fy * in_projector.y() / in_projector.z();
  pixel_from_move /= in_projector.z();
  Eigen::Matrix<double, 3, 2> edges;
  edges << e1, e2;
  const Eigen::Matrix2d pixels =
      pixel_from_move * (projector_from_world_.rotation.toRotationMatrix() * edges);
  const Vector3d face = e1.cross(e2);
  // By the triangle and not its smoothed normal: at the outline that may face the other way.
  if (!(face.dot(to_projector) > 0.0)) return std::nullopt;
  Eigen::Matrix2d repeats;
  repeats << c[1].repeats - c[0].repeats, c[2].repeats - c[0].repeats;
  const double covered = std::abs(pixels.determinant());
  point.pixels_per_area = covered / face.norm();
  point.repeats_per_pixel =
      covered > 0.0 ? std::sqrt(std::abs(repeats.determinant()) / covered) : 0.0;
  if (is_hidden(in_projector, std::min(1.0, face.normalized().dot(to_projector) / distance)))
    return std::nullopt;
  return point;
}

}  // namespace veneer::quality
