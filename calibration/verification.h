// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
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
[[nodiscard]] std::vector<VerificationPatch> verification_patches(const ProjectorProfile& profile,
                                                                  int count,
                                                                  std::uint64_t seed);

/// How far a profile's predictions lie from readings, dE00 against the white that full drive sends
/// from a perfect diffuser that faces the lens at the reference distance (black included).
struct ProfileVerification {
  std::vector<double> de00;  ///< one a patch, in their order
  double de00_mean = 0;
  double de00_p95 = 0;
  double de00_max = 0;
};

/// Errors: kInvalidOption (no patches), kBadFormat (the profile; a reading that is no number), what
/// the devices return.
[[nodiscard]] Result<ProfileVerification> verify_profile(
    Colorimeter& colorimeter,
    PatchDisplay& display,
    const ProjectorProfile& profile,
    const std::vector<VerificationPatch>& patches,
    Progress& progress);

}  // namespace veneer::calibration
