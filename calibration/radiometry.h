// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "calibration/colour/additivity.h"
#include "calibration/colour/colour_model.h"
#include "calibration/colour/selection.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/patch_display.h"
#include "calibration/profile.h"

namespace veneer::calibration {

struct RadiometryOptions {
  /// Of a drive code. 4 to 16.
  int bits = 8;
  /// From the lens to the board of Target, on the projector's axis. > 0.
  double reference_distance_m = 1.0;
  /// Levels of each channel's ramp, black left out; they lie closer in the dark. 4 to 40.
  int levels = 18;
  /// Readings that are averaged for ambient, black and each channel's full drive. 1 to 100.
  int repeats = 4;
  /// Readings that are averaged for every other patch; more for a noisy instrument. 1 to 100.
  int patch_repeats = 1;
  /// Patches that no model is fitted to, by which one is chosen. 8 to 1000.
  int held_out = 32;
  /// Nodes along an axis of the cube of mixtures that is read where the channels do not add up; see
  /// ColourPatchOptions.
  int cube = 4;
  /// Spots over the raster at which the fall-off is read. 2 to 100 each.
  int vignetting_columns = 9;
  int vignetting_rows = 7;
  /// The fall-off, where it is known from elsewhere (a camera): the spots are not read then.
  Image<float> known_fall_off;
  [[nodiscard]] Status check() const;
};

/// A profile and what was found out on the way to it.
struct MeasuredProfile {
  ProjectorProfile profile;
  /// (R + G + B - W) / W of the luminances above black.
  double additivity_error = 0;
  Additivity additivity;
  /// Every colour model that was tried, and why one was taken.
  std::vector<ColourCandidate> candidates;
  std::string choice;
  ColourError held_out;    ///< of the chosen model, on patches that it was not fitted to
  int fitted_patches = 0;  ///< different drives
  int patch_repeats = 1;   ///< readings that each of `patches` is the mean of
  /// Of the white board at the raster's centre, in the order of reading; ambient and black in them.
  std::vector<PatchReading> patches;
  Xyz black = Xyz::Zero();  ///< what drive 0 reads among them
  /// Per channel: the part of the light at full drive by which a ramp's colour strays at most from
  /// one fixed direction in XYZ. Levels under 5 % of full output are left out: they are all noise.
  std::array<double, 3> colour_drift{};
  /// |what the object sends of the ambient light - A E| / |A E|; 0 where there is no ambient light.
  double ambient_mismatch = 0;
  /// White at the end over white at the beginning, less 1.
  double lamp_drift = 0;
  int readings = 0;
  std::vector<std::string> warnings;  ///< for people; empty when all is well
};

/// Measures colour, black, fall-off, surface and ambient light.
///
/// `geometry` is not measured but taken as given: it must come from a geometric calibration of the
/// same projector, because the slant of the board at each pixel is divided out with it. The
/// reference of M and of the vignetting is the centre of the raster.
///
/// Mixtures tell whether the channels add up (additivity.h). If not, a cube of mixtures is read
/// besides the ramps. Every colour model that may be used is fitted, the best on held-out patches
/// is taken (selection.h) and tabulated (baking.h). A = M_object M_white^-1 with the primaries read
/// on both, exact for the spectra of these three primaries.
///
/// Errors: kInvalidOption; what the devices return (a time-out is tried again, twice); kBadFormat
/// for readings that make no profile: not finite, a dead channel, a ramp that falls by more than 2
/// % of full output, a black that is darker than the lamp switched off, a spot without light.
[[nodiscard]] Result<MeasuredProfile> measure_profile(Colorimeter& colorimeter,
                                                      PatchDisplay& display,
                                                      const ProjectorGeometry& geometry,
                                                      const RadiometryOptions& options,
                                                      Progress& progress);

/// What the profile expects the colorimeter to read (XYZ, cd/m^2), see Target. Of the object, it is
/// the place that `pixel` lights, as the profile's map of the surface has it.
/// @param pixel  on the raster.   @param code  below 2^bits.
[[nodiscard]] Xyz predict_reading(const ProjectorProfile& profile,
                                  Target target,
                                  const Eigen::Vector2d& pixel,
                                  const std::array<std::uint16_t, 3>& code,
                                  bool lit = true);

}  // namespace veneer::calibration
