// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/colour.h"
#include "base/image.h"
#include "base/result.h"
#include "base/rigid_transform.h"

namespace veneer::calibration {

/// Pinhole of the projector, pixels; +z forward, x right, y down, first pixel centre (0.5, 0.5).
struct ProjectorGeometry {
  int width = 0;
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  RigidTransform world_from_projector;
};

/// Of the values of ProjectorProfile::surface_map. No surface is so dark; shaders divide by them.
inline constexpr float kLeastReflectance = 1e-6F;

/// All that compensation knows of the projector, the surface and the room.
///
/// With drive d in [0,1]^3, tone curves t, primaries M, black k, geometry G and surface A, the
/// luminance of a point x is, in XYZ and cd/m^2,
///   L(x) = A(x) [ G(x) (M t(d) + k) + E ],   G(x) = cos(theta_p) (r_ref / r)^2 vignetting(pixel),
///   A(x) = A M diag(s(pixel)) M^-1:
/// what differs over the surface is diagonal in the projector's primaries, on top of A.
/// M, k and E are those of a perfect diffuser: M and k one that faces the lens at distance
/// r_ref in the direction of the raster's centre, E wherever the object stands.
struct ProjectorProfile {
  ProjectorGeometry geometry;
  int bits = 8;  ///< of a drive code
  /// Per channel, 2^bits values: relative output t of every code, not falling, t[0] = 0, t[last]
  /// = 1.
  std::array<std::vector<double>, 3> tone_curves;
  Eigen::Matrix3d primaries = Eigen::Matrix3d::Identity();  ///< M: columns are XYZ of R, G, B
  Xyz black = Xyz::Zero();                                  ///< k
  double reference_distance_m = 1.0;                        ///< r_ref
  /// Radiant intensity over the raster, 1 at its centre; any size, stretched over it, bilinear
  /// between texel centres as GL does, clamped beyond them.
  Image<float> vignetting;
  Eigen::Matrix3d surface = Eigen::Matrix3d::Identity();  ///< A, in XYZ, where it was read
  /// s, the surface's reflectance over the raster relative to A: one value for each primary, from
  /// kLeastReflectance to its inverse; size and lookup as of `vignetting`. Empty: 1 everywhere.
  Image<Rgb32f> surface_map;
  Xyz ambient = Xyz::Zero();  ///< E

  /// The maps at a place on the raster, pixels; 1 where a map is empty.
  [[nodiscard]] double vignetting_at(const Eigen::Vector2d& pixel) const;
  [[nodiscard]] Eigen::Vector3d reflectance_at(const Eigen::Vector2d& pixel) const;

  /// Sizes, finiteness, monotony and that M and A can be inverted. Errors: kBadFormat.
  [[nodiscard]] Status check() const;
  /// A folder with profile.json (version, checksums), vignetting.exr and, unless the map is empty,
  /// surface_map.exr; whole or not at all.
  [[nodiscard]] Status save(const std::filesystem::path& folder) const;
  /// Errors: kNotFound, kBadFormat (damaged, checksum, newer version; says which).
  [[nodiscard]] static Result<ProjectorProfile> load(const std::filesystem::path& folder);
};

}  // namespace veneer::calibration
