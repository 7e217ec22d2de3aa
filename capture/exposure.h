// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "capture/camera.h"

namespace veneer::capture {

/// How a picture uses the range of the camera.
struct ExposureCheck {
  double saturated_fraction = 0;  ///< of the pixels, any channel at full scale
  double p99 = 0;     ///< 99 % of the pixels' brightest channels are below; of full scale
  double median = 0;  ///< of the pixels' brightest channels; of full scale
};

[[nodiscard]] ExposureCheck check_exposure(const CameraFrame& frame);

/// The exposure, in seconds, that brings the picture's p99 to 70 % of full scale. A picture that is
/// saturated or nearly black says only the direction: then it is a quarter or sixteen times.
[[nodiscard]] double better_exposure(const CameraFrame& frame);

}  // namespace veneer::capture
