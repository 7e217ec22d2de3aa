// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "base/image.h"
#include "base/result.h"
#include "calibration/maps/fall_off.h"
#include "calibration/maps/map_quality.h"
#include "calibration/profile.h"

namespace veneer::calibration {

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
