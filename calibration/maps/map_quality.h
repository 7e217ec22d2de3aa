// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/result.h"

namespace veneer::calibration {

/// Of the maps through the camera.
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

}  // namespace veneer::calibration
