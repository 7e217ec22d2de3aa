// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>

#include "base/image.h"
#include "base/result.h"
#include "calibration/maps/fall_off.h"
#include "calibration/maps/map_quality.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// The camera's pictures of an object that stands still while each primary is shown alone, and
/// where the light of every camera pixel came from. Borrowed for the call; all of one size.
struct SurfacePictures {
  /// Each primary alone at full drive; exposures may differ.
  std::array<ImageView<const Rgb16>, 3> primaries;
  /// Black, exposed as each of the above was; three times the same where they were exposed alike.
  std::array<ImageView<const Rgb16>, 3> blacks;
  /// Projector pixels, first centre (0.5, 0.5); NaN where not decoded (geometry::DecodedView).
  ImageView<const Eigen::Vector2f> projector;
  ImageView<const float> confidence;  ///< 0 to 1, of DecodedView; empty: 1 everywhere
};

struct SurfaceMap {
  /// As ProjectorProfile::surface_map: the reflectance relative to the reference place, one value a
  /// primary; from kLeastReflectance, or its own noise where that is more, to 1 /
  /// kLeastReflectance.
  Image<Rgb32f> map;
  Image<Rgb32f> noise;  ///< standard deviation of `map`; 0 where it is not seen
  /// The camera's channel that was taken for each primary.
  std::array<int, 3> channels{};
  /// Relative standard deviation of what the map is relative to, a primary each.
  Eigen::Vector3d reference_noise = Eigen::Vector3d::Zero();
  MapQuality quality;
};

/// The object's reflectance over the raster through a camera, relative to a place on it.
///
/// A camera pixel that the raster place x lights counts, above black and for primary c,
///   counts = gain_c s_c(x) F(x) vignetting(x) camera fall-off(pixel),
/// F the form factor cos(theta_p) (r_ref / r)^2. The surface is taken as matte, so the camera's own
/// slant is not in it. s is the sum of counts over the sum of the other factors, over the camera
/// pixels that a texel lights: the mean over its area by light.
///
/// A camera mixes primaries: its three channels are a 3 x 3 matrix of them. Lit one at a time,
/// nothing has to be unmixed: for each primary the channel is taken that counts it strongest. It
/// sees most of the primary's own line and least of what leaks in of others, has nearly all of the
/// signal, and where it is not saturated, no other is.
///
/// @param form_factor  F over the raster, of any size, stretched over it (nearest texel); 0 (or
/// NaN) where
///                     the object is not. From the mesh and its pose, or form_factor_map() of the
///                     object while it was white.
/// @param profile  raster and vignetting are used.
/// @param reference  raster place at which A was read.   @param reference_radius_px  of the spot
///                   that was read, raster pixels; above 0.
/// Errors: kInvalidOption (options, sizes), kBadFormat (no light, or too few sure pixels, at the
/// reference place; the text says what to do).
[[nodiscard]] Result<SurfaceMap> measure_surface_map(const SurfacePictures& pictures,
                                                     ImageView<const float> form_factor,
                                                     const ProjectorProfile& profile,
                                                     const CameraFallOff& camera,
                                                     const Eigen::Vector2d& reference,
                                                     double reference_radius_px,
                                                     const MapOptions& options);

}  // namespace veneer::calibration
