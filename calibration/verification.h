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

/// One reading that a profile is held against.
struct VerificationPatch {
  std::array<std::uint16_t, 3> code{};
  Target target = Target::kWhiteReference;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// Patches that no calibration was fitted on: random codes at random spots of the inner 90 % of the
/// raster, every other one on the object. The same for the same seed.
/// @param move  false: all at the raster's centre, those on the board first, for an instrument that
/// a person has to point.
[[nodiscard]] std::vector<VerificationPatch> verification_patches(const ProjectorProfile& profile,
                                                                  int count,
                                                                  std::uint64_t seed,
                                                                  bool move = true);

/// A patch as it was read and as the profile has it, XYZ in cd/m^2.
struct VerifiedPatch {
  VerificationPatch patch;
  Xyz read = Xyz::Zero();  ///< mean of the repeats
  Xyz predicted = Xyz::Zero();
  double de00 = 0;
};

/// How far a profile's predictions lie from readings, dE00 against the white that full drive sends
/// from a perfect diffuser that faces the lens at the reference distance (black included).
struct ProfileVerification {
  Xyz white = Xyz::Zero();
  std::vector<VerifiedPatch> patches;  ///< in their order
  double de00_mean = 0;
  double de00_p95 = 0;
  double de00_max = 0;
  /// (R + G + B - W) / W of the luminances above black, read on the board at the raster's centre.
  double additivity_error = 0;
  /// What the scatter of the readings alone would give if the profile were perfect.
  double noise_de00_mean = 0;
  double noise_de00_p95 = 0;
  double relative_noise = 0;  ///< of one reading of X, Y or Z, pooled over the patches
};

struct VerificationOptions {
  int repeats = 4;  ///< readings of each patch that are averaged. 1 to 100
};

/// Errors: kInvalidOption (no patches, repeats), kBadFormat (the profile; a reading that is no
/// number), what the devices return (a time-out is tried again, twice).
[[nodiscard]] Result<ProfileVerification> verify_profile(
    Colorimeter& colorimeter,
    PatchDisplay& display,
    const ProjectorProfile& profile,
    const std::vector<VerificationPatch>& patches,
    const VerificationOptions& options,
    Progress& progress);

/// What a verification says of a profile.
struct Verdict {
  bool good = false;             ///< no gate is missed
  bool calibrate_again = false;  ///< what was once measured does not hold any more
  std::string sentence;
  /// dE00 that mean, 95th percentile and maximum were held against.
  double gate_mean = 0;
  double gate_p95 = 0;
  double gate_max = 0;
};

/// Gates are 0.5, 1 and 2 dE00 where the channels do not act on each other (residual and additivity
/// say so) and 1, 2 and 4 where they do, each widened by what the readings' own scatter leaves in
/// the fit and in the check: one and a half times the dE00 that a single reading's scatter makes.
[[nodiscard]] Verdict judge(const ProfileVerification& verification);

}  // namespace veneer::calibration
