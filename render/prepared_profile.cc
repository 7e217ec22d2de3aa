// SPDX-License-Identifier: Apache-2.0
#include "render/prepared_profile.h"

#include <cmath>
#include <utility>

#include "base/ipt.h"

namespace veneer::render {

PreparedProfile::PreparedProfile(calibration::ProjectorProfile profile,
                                 const RendererOptions& options)
    : profile_(std::move(profile)),
      compensation_(profile_, options),
      vignetting_(vignetting_raster(profile_)),
      reflectance_(reflectance_raster(profile_)) {}

Result<PreparedProfile> PreparedProfile::prepare(calibration::ProjectorProfile profile,
                                                 const RendererOptions& options) {
  if (!(options.geometry_floor > 0.0) || !std::isfinite(options.geometry_floor))
    return fail(Errc::kInvalidOption,
                "preparing a profile: geometry_floor is {}; it must be above 0",
                options.geometry_floor);
  if (!(options.luminance_ceiling >= 0.0) || !std::isfinite(options.luminance_ceiling))
    return fail(
        Errc::kInvalidOption,
        "preparing a profile: luminance_ceiling is {} cd/m^2; it must be a number above 0, or "
        "0 for none",
        options.luminance_ceiling);
  VENEER_TRY(profile.check());
  const Xyz white = profile.white();
  if (!((cones_from_xyz() * white).minCoeff() > 0.0))
    return fail(
        Errc::kBadFormat,
        "preparing a profile: its white, XYZ {} {} {}, is no colour that an eye can see; calibrate "
        "again",
        white.x(),
        white.y(),
        white.z());
  return PreparedProfile(std::move(profile), options);
}

Status check_exchangeable(const RasterFormat& current, const calibration::ProjectorProfile& next) {
  const calibration::ProjectorGeometry& g = next.geometry;
  if (g.width == current.width && g.height == current.height && next.bits == current.bits)
    return {};
  return fail(
      Errc::kInvalidOption,
      "exchanging the profile: it is for {} x {} pixels of {} bits, and the picture has {} x "
      "{} of {}; restart to use it",
      g.width,
      g.height,
      next.bits,
      current.width,
      current.height,
      current.bits);
}

}  // namespace veneer::render
