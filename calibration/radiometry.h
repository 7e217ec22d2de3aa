// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/patch_display.h"
#include "calibration/profile.h"

namespace veneer::calibration {

struct RadiometryOptions {
  /// Of a drive code. 1 to 16.
  int bits = 8;
  /// From the lens to the board of Target, on the projector's axis. > 0.
  double reference_distance_m = 1.0;
  /// Levels of each channel's ramp, black left out; they lie closer in the dark. 4 to 2^bits - 1.
  int levels = 20;
  /// Readings that are averaged for ambient, black and each channel's full drive. 1 to 100.
  int repeats = 4;
  /// Spots over the raster at which the fall-off is read. 2 to 100 each.
  int vignetting_columns = 9;
  int vignetting_rows = 7;
  [[nodiscard]] Status check() const;
};

/// A profile and what was found out on the way to it.
struct MeasuredProfile {
  ProjectorProfile profile;
  /// (R + G + B - W) / W of the luminances above black. Over +-3 % there is a warning: the model
  /// M t(d) + k does not fit this projector (a white segment, channels that share a supply).
  double additivity_error = 0;
  /// Per channel: the part of the light at full drive by which a ramp's colour strays at most from
  /// one fixed direction in XYZ. Levels under 5 % of full output are left out: they are all noise.
  std::array<double, 3> colour_drift{};
  /// |what the object sends of the ambient light - A E| / |A E|; 0 where there is no ambient light.
  double ambient_mismatch = 0;
  int readings = 0;
  std::vector<std::string> warnings;  ///< for people; empty when all is well
};

/// Measures tone curves, primaries, black, vignetting, surface and ambient light.
///
/// `geometry` is not measured but taken as given: it must come from a geometric calibration of the
/// same projector, because the slant of the board at each pixel is divided out with it. The
/// reference of M and of the vignetting is the centre of the raster.
///
/// Per channel the output t is the length of (reading - black) along the channel's direction, which
/// is the least-squares one through all levels; noise is taken out with the nearest rising
/// sequence, and the codes between are filled in with a monotone cubic. A = M_object M_white^-1
/// with the primaries read on both, exact for the spectra of these three primaries.
///
/// Errors: kInvalidOption; what the devices return (a time-out is tried again, twice); kBadFormat
/// for readings that make no profile: not finite, a dead channel, a ramp that falls by more than 2
/// % of full output, a black that is darker than the lamp switched off, a spot without light.
[[nodiscard]] Result<MeasuredProfile> measure_profile(Colorimeter& colorimeter,
                                                      PatchDisplay& display,
                                                      const ProjectorGeometry& geometry,
                                                      const RadiometryOptions& options,
                                                      Progress& progress);

/// The codes of a ramp: `levels` different ones from above 0 to full, about equally spaced in L* on
/// a display of exponent 2.2.
[[nodiscard]] std::vector<std::uint16_t> ramp_codes(int bits, int levels);

/// What the profile expects the colorimeter to read (XYZ, cd/m^2), see Target. Of the object, it is
/// the place that `pixel` lights, as the profile's map of the surface has it.
/// @param pixel  on the raster.   @param code  below 2^bits.
[[nodiscard]] Xyz predict_reading(const ProjectorProfile& profile,
                                  Target target,
                                  const Eigen::Vector2d& pixel,
                                  const std::array<std::uint16_t, 3>& code,
                                  bool lit = true);

}  // namespace veneer::calibration
