// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to quality/.

#include <Eigen/Core>

#include <array>
#include <optional>
#include <vector>

#include "base/image.h"
#include "calibration/profile.h"
#include "render/scene.h"

namespace veneer::quality {

/// A point of the surface that the projector reaches; world frame, metres.
struct SurfacePoint {
  Eigen::Vector3d position;
  Eigen::Matrix3d local_from_world;  ///< rows: tangent, normal cross tangent, normal
  Eigen::Vector2d repeats;           ///< of the sample, as the shader's uv
  Eigen::Vector2d pixel;
  double geometry = 0;           ///< cos(theta_p) (r_ref / r)^2
  double vignetting = 1;         ///< at the pixel
  double pixels_per_area = 0;    ///< pixels a square metre of surface covers
  double repeats_per_pixel = 0;  ///< along a pixel's side: the root of the repeats it covers
};

/// The object as the scene puts it before the projector.
class ProjectedSurface {
 public:
  /// @param profile  borrowed.
  ProjectedSurface(const render::Scene& scene, const calibration::ProjectorProfile& profile);

  /// A point of the surface, evenly by area. @param at  in [0, 1]^3: which triangle, and where on
  /// it. Nothing where the projector does not reach it: it is behind the lens, off the raster,
  /// faces away, G is under `geometry_floor`, or another part of the object hides it.
  [[nodiscard]] std::optional<SurfacePoint> at(const Eigen::Vector3d& at,
                                               double geometry_floor) const;
  /// A corner of the mesh, likewise. @param corner  below 3 triangles().
  [[nodiscard]] std::optional<SurfacePoint> corner(std::size_t corner, double geometry_floor) const;
  [[nodiscard]] std::size_t triangles() const { return triangles_.size(); }

 private:
  struct Corner {
    Eigen::Vector3d position;  // world
    Eigen::Vector3d normal;
    Eigen::Vector3d tangent;
    Eigen::Vector2d repeats;
  };
  struct Triangle {
    std::array<Corner, 3> corners;
    double area_up_to_here = 0;
  };
  [[nodiscard]] std::optional<SurfacePoint> point(const Triangle& triangle,
                                                  const Eigen::Vector3d& barycentric,
                                                  double geometry_floor) const;
  void draw_depths();
  [[nodiscard]] bool is_hidden(const Eigen::Vector3d& in_projector, double cos_theta) const;

  const calibration::ProjectorProfile& profile_;
  RigidTransform projector_from_world_;
  std::vector<Triangle> triangles_;
  Image<float> depths_;  // least z over a coarse raster; infinite where nothing is
  double cells_per_pixel_ = 1;
};

}  // namespace veneer::quality
