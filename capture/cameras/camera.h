// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "base/clock.h"
#include "base/image.h"
#include "base/result.h"

namespace veneer::capture {

/// What a camera gave: linear counts, not corrected for anything.
struct CameraFrame {
  /// First row on top, first pixel centre (0.5, 0.5). A monochrome camera repeats its value.
  Image<Rgb16> counts;
  /// Counts of a saturated pixel.
  std::uint16_t full_scale = 65535;
  double exposure_s = 0;
  Time time;  ///< middle of the exposure
};

/// The camera HAL. One thread.
class Camera {
 public:
  virtual ~Camera() = default;
  [[nodiscard]] virtual std::string description() const = 0;
  [[nodiscard]] virtual int width() const = 0;
  [[nodiscard]] virtual int height() const = 0;
  /// Takes effect with the next grab. A device may round it; CameraFrame::exposure_s says to what.
  /// Errors: kInvalidOption (out of the camera's range, which is named).
  [[nodiscard]] virtual Status set_exposure(double seconds) = 0;
  /// One picture, exposed after the call began.
  /// Errors: kTimeout (try again), kDisconnected.
  [[nodiscard]] virtual Result<CameraFrame> grab() = 0;
};

}  // namespace veneer::capture
