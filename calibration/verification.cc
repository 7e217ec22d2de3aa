// SPDX-License-Identifier: Apache-2.0
#include "calibration/verification.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "base/statistics.h"
#include "calibration/radiometry.h"

namespace veneer::calibration {

std::vector<VerificationPatch> verification_patches(const ProjectorProfile& profile,
                                                    int count,
                                                    std::uint64_t seed) {
  Pcg32 random(seed);
  const double codes = std::ldexp(1.0, profile.bits);
  std::vector<VerificationPatch> patches(static_cast<std::size_t>(std::max(count, 0)));
  bool on_object = false;
  for (VerificationPatch& patch : patches) {
    for (std::uint16_t& code : patch.code)
      code = static_cast<std::uint16_t>(codes * random.uniform());
    patch.pixel.x() = profile.geometry.width * std::lerp(0.05, 0.95, random.uniform());
    patch.pixel.y() = profile.geometry.height * std::lerp(0.05, 0.95, random.uniform());
    patch.target = on_object ? Target::kObject : Target::kWhiteReference;
    on_object = !on_object;
  }
  return patches;
}

Result<ProfileVerification> verify_profile(Colorimeter& colorimeter,
                                           PatchDisplay& display,
                                           const ProjectorProfile& profile,
                                           const std::vector<VerificationPatch>& patches,
                                           Progress& progress) {
  if (patches.empty())
    return fail(Errc::kInvalidOption, "verifying a profile: there are no patches");
  if (const Status valid = profile.check(); !valid)
    return fail_while("verifying a profile", valid.error());
  const Xyz white = profile.white();

  ProfileVerification verification;
  progress.start("verifying the profile", static_cast<std::int64_t>(patches.size()));
  for (const VerificationPatch& patch : patches) {
    VENEER_TRY(display.show(patch.code));
    VENEER_ASSIGN(const Xyz reading, colorimeter.read(patch.target, patch.pixel));
    if (!reading.allFinite())
      return fail(Errc::kBadFormat,
                  "verifying a profile: {} gave a value that is not a number; read again",
                  colorimeter.description());
    const Xyz predicted = predict_reading(profile, patch.target, patch.pixel, patch.code);
    verification.de00.push_back(
        delta_e_2000(lab_from_xyz(reading, white), lab_from_xyz(predicted, white)));
    progress.advance();
  }

  verification.de00_mean = mean(verification.de00);
  verification.de00_p95 = quantile(verification.de00, 0.95);
  verification.de00_max = quantile(verification.de00, 1.0);
  progress.finish(fmt::format("dE00 mean {:.2f}", verification.de00_mean));
  return verification;
}

}  // namespace veneer::calibration
