// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "calibration/maps/fall_off.h"
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

struct MapOptions {
  int width = 0;  ///< of the map, texels; 0: as many as the raster has pixels
  int height = 0;
  /// Counts at or above this are saturated; 0: none are.
  double full_scale = 65535;
  double least_confidence = 0.1;  ///< of a decoded pixel; 0 to 1
  /// Standard deviation of a count in the dark, and variance a count of light adds (what one
  /// electron counts). 0 or more.
  double dark_noise = 1;
  double counts_per_electron = 0;
  /// Where a place on the raster gets less than this part of the light at the reference place (its
  /// slant, its distance, the fall-off), the map is filled from its neighbours. Above 0, up to 1.
  double least_light = 0.1;
  /// Likewise where the noise of the map's value exceeds this. Above 0.
  double most_noise = 0.1;
  /// How far a hole is filled from its neighbours, texels; beyond it the map is 1. 0 to 1000.
  int most_fill = 8;

  [[nodiscard]] Status check() const;  ///< Errors: kInvalidOption
};

/// What a value of a map came from.
enum class MapSource : std::uint8_t {
  kNone,    ///< nothing: 1
  kSeen,    ///< camera pixels
  kFilled,  ///< neighbours
};

/// What both maps have to say of their pixels.
struct MapQuality {
  Image<MapSource> source;
  // Parts of the texels that are on the object: those with a form factor, or without one all that
  // the camera saw.
  double seen = 0;
  double filled = 0;
  // Camera pixels that were decoded but not used:
  std::int64_t saturated = 0;
  std::int64_t unsure = 0;      ///< under least_confidence
  std::int64_t stray = 0;       ///< off the raster or, by the form factor, off the object
  double pixels_per_texel = 0;  ///< median over the texels seen
  std::vector<std::string> warnings;
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
/// pixels of a texel (shared by area between the four nearest): the mean over its area by light.
///
/// A camera mixes primaries: its three channels are a 3 x 3 matrix of them. Lit one at a time,
/// nothing has to be unmixed: for each primary the channel is taken that counts it strongest. It
/// sees most of the primary's own line and least of what leaks in of others, has nearly all of the
/// signal, and where it is not saturated, no other is.
///
/// @param form_factor  F over the raster, of any size, stretched over it (nearest texel); 0 where
///                     the object is not. From the mesh and its pose, or form_factor_map() of the
///                     object while it was white.
/// @param geometry  raster size alone is used.
/// @param vignetting  as of ProjectorProfile; empty: 1 everywhere.
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

struct FormFactorMap {
  /// F over the raster; 0 where nothing was seen of the object nor filled in.
  Image<float> map;
  Image<float> noise;  ///< standard deviation of `map`; 0 where it is not seen
  MapQuality quality;
};

/// The form factor of an object without a mesh, from pictures under full white while it is white
/// and matte all over (primed, before it is painted): counts relative to those of a place whose
/// form factor is known, such as a board at the reference distance. The channels are summed. Of an
/// object that is not white this is the form factor times its reflectance.
/// @param reference_counts  what the camera would count above black, all channels summed, of the
///                          same white at F = 1, at its centre and the raster's.
[[nodiscard]] Result<FormFactorMap> measure_form_factor(ImageView<const Rgb16> white,
                                                        ImageView<const Rgb16> black,
                                                        ImageView<const Eigen::Vector2f> projector,
                                                        ImageView<const float> confidence,
                                                        const ProjectorProfile& profile,
                                                        const CameraFallOff& camera,
                                                        double reference_counts,
                                                        const MapOptions& options);

}  // namespace veneer::calibration
