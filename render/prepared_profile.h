// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/image.h"
#include "base/result.h"
#include "calibration/profile.h"
#include "render/compensation.h"
#include "render/renderer.h"

namespace veneer::render {

/// A profile with all that is worked out of it once, ready to be given to a renderer. Needs no GL:
/// any thread may make it.
class PreparedProfile {
 public:
  /// Errors: kInvalidOption, kBadFormat (ProjectorProfile::check; a white that no eye can see).
  [[nodiscard]] static Result<PreparedProfile> prepare(calibration::ProjectorProfile profile,
                                                       const RendererOptions& options);

  [[nodiscard]] const calibration::ProjectorProfile& profile() const { return profile_; }
  [[nodiscard]] const Compensation& compensation() const { return compensation_; }
  [[nodiscard]] const Image<float>& vignetting() const { return vignetting_; }
  [[nodiscard]] const Image<Rgb32f>& reflectance() const { return reflectance_; }

 private:
  PreparedProfile(calibration::ProjectorProfile profile, const RendererOptions& options);

  calibration::ProjectorProfile profile_;
  Compensation compensation_;
  Image<float> vignetting_;    // vignetting_raster()
  Image<Rgb32f> reflectance_;  // reflectance_raster()
};

/// What a renderer and its output are made for and no profile can change.
struct RasterFormat {
  int width = 0;
  int height = 0;
  int bits = 8;
};
/// Whether a renderer of this raster can take the profile. Errors: kInvalidOption; says to restart.
[[nodiscard]] Status check_exchangeable(const RasterFormat& current,
                                        const calibration::ProjectorProfile& next);

}  // namespace veneer::render
