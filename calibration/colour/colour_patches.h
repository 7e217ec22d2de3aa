// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// Which patches to show; every list is the same for the same options.
struct ColourPatchOptions {
  int bits = 8;  ///< of a drive code, 4 to 16
  /// Levels of each channel's ramp, black left out; equally spaced in L*, so denser in the dark. 4
  /// to 40, and less than 2^bits.
  int ramp_levels = 16;
  /// Readings of black, which all other readings are counted from. 1 to 100.
  int black_repeats = 4;
  /// Levels of the grey axis, black left out, for models of interaction. 0 to 40: levels of the
  /// ramps are taken, so that a sum of channels can be formed at each.
  int grey_levels = 16;
  /// Nodes along an axis of the cube of mixtures, black included, for models of interaction: the
  /// cube^3 patches less the ones that are there already. 0 or 2 to 9.
  int cube = 4;
  /// Readings of each patch in additivity_patches(). 1 to 100.
  int additivity_repeats = 4;
  [[nodiscard]] Status check() const;
};

/// The codes of a ramp: `levels` different ones from above 0 to full, about equally spaced in L* on
/// a display of exponent 2.2.
[[nodiscard]] std::vector<std::uint16_t> ramp_codes(int bits, int levels);

/// Black and three ramps: all that models without interaction need, 3 ramp_levels + black_repeats.
/// @param options  must pass check(), as below.
[[nodiscard]] std::vector<Rgb16> ramp_patches(const ColourPatchOptions& options);

/// What models of interaction need besides: the grey axis and the mixtures of a cube, none of them
/// in ramp_patches(). Secondaries and white are among them.
[[nodiscard]] std::vector<Rgb16> interaction_patches(const ColourPatchOptions& options);

/// Single channels, their secondaries and white, at full drive and at about half of the light:
/// 14 patches, each `additivity_repeats` times, the repeats apart in time.
[[nodiscard]] std::vector<Rgb16> additivity_patches(const ColourPatchOptions& options);

/// Patches that tell how good a fit is: `count` colours spread evenly through the cube of drives
/// whose light is equally spaced in lightness, none of which is in `fitted`.
/// @param count  1 to 1000, and far fewer than there are codes.
[[nodiscard]] std::vector<Rgb16> verification_patches(int bits,
                                                      int count,
                                                      std::span<const Rgb16> fitted);

/// Patches of an independent verification: as many as the small list that is customary for
/// displays.
inline constexpr int kVerificationPatches = 43;

/// code / (2^bits - 1).
[[nodiscard]] Eigen::Vector3d drive_of_code(const Rgb16& code, int bits);

}  // namespace veneer::calibration
