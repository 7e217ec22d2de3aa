// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/colour.h"
#include "base/image.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "calibration/colour_residual.h"

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

/// Writes further files into the folder of a profile before it appears, so that all appear at once.
using ExtraFiles = std::function<Status(const std::filesystem::path& folder)>;

/// All that compensation knows of the projector, the surface and the room.
///
/// With drive d in [0,1]^3, tone curves t, primaries M, the residual rho of the colour model, black
/// k, geometry G and surface A, the luminance of a point x is, in XYZ and cd/m^2,
///   L(x) = A(x) [ G(x) (M (t(d) + rho(t(d))) + k) + E ],
///   G(x) = cos(theta_p) (r_ref / r)^2 vignetting(pixel),   A(x) = A M diag(s(pixel)) M^-1:
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
  /// rho: what tone curves and M leave of the projector's colour. Empty: nothing.
  ColourResidual residual;
  Xyz black = Xyz::Zero();            ///< k
  double reference_distance_m = 1.0;  ///< r_ref
  /// Radiant intensity over the raster, 1 at its centre; any size, stretched over it, bilinear
  /// between texel centres as GL does, clamped beyond them.
  Image<float> vignetting;
  Eigen::Matrix3d surface = Eigen::Matrix3d::Identity();  ///< A, in XYZ, where it was read
  /// s, the surface's reflectance over the raster relative to A: one value for each primary, from
  /// kLeastReflectance to its inverse; size and lookup as of `vignetting`. Empty: 1 everywhere.
  Image<Rgb32f> surface_map;
  Xyz ambient = Xyz::Zero();  ///< E
  /// For people: the colour model that was fitted, empty where nobody said, and how the profile
  /// came about (when, instrument, state of the projector, errors that were held out). UTF-8.
  std::string colour_model;
  std::map<std::string, std::string> record;

  /// t of a code.   @param code  below 2^bits.
  [[nodiscard]] Eigen::Vector3d linear_drive(const std::array<std::uint16_t, 3>& code) const;
  /// M (t + rho(t)): the light above black, XYZ in cd/m^2 at the reference.
  [[nodiscard]] Xyz emitted(const Eigen::Vector3d& linear_drive) const;
  /// What full drive sends at the reference, black included.
  [[nodiscard]] Xyz white() const;
  /// The maps at a place on the raster, pixels; 1 where a map is empty.
  [[nodiscard]] double vignetting_at(const Eigen::Vector2d& pixel) const;
  [[nodiscard]] Eigen::Vector3d reflectance_at(const Eigen::Vector2d& pixel) const;

  /// Sizes, finiteness, monotony, that M and A can be inverted, and that t -> t + rho(t) can: it
  /// keeps the orientation of every cell of the residual's grid. Errors: kBadFormat.
  [[nodiscard]] Status check() const;
  /// A folder with profile.json (version, checksums), vignetting.exr and, where they are not empty,
  /// surface_map.exr and colour_residual.exr (nodes x nodes^2: r along a row, rows g and then b;
  /// rho in single precision); whole or not at all.
  /// @param extra  called last, and what it returns is returned.
  [[nodiscard]] Status save(const std::filesystem::path& folder,
                            const ExtraFiles& extra = {}) const;
  /// Errors: kNotFound, kBadFormat (damaged, checksum, newer version; says which). Versions 1 (no
  /// map of the surface) and 2 (no residual) are read.
  [[nodiscard]] static Result<ProjectorProfile> load(const std::filesystem::path& folder);
};

}  // namespace veneer::calibration
