// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/image.h"
#include "base/result.h"

namespace veneer::capture {

/// What the pixels of a picture saw.
enum class Mosaic : std::uint8_t {
  kNone,         ///< every pixel all that the camera sees
  kPolarMono,    ///< cells of 2 x 2 behind analysers at 90, 45; 135, 0 degrees (Sony Polarsens)
  kPolarColour,  ///< the same under a Bayer pattern of 2 x 2 such cells: R G; G B
};

/// What a camera gave: counts as they were read, not corrected for anything. Linear unless the
/// camera's curve is known to be another (DSLR JPEG, V4L2).
struct CameraFrame {
  /// First row on top, first pixel centre (0.5, 0.5). A monochrome camera repeats its value, and so
  /// does a mosaic, each pixel its own.
  Image<Rgb16> counts;
  /// Counts of a saturated pixel.
  std::uint16_t full_scale = 65535;
  double exposure_s = 0;
  Time time;  ///< middle of the exposure
  Mosaic mosaic = Mosaic::kNone;
  /// The camera's own number of the picture, to notice lost and repeated ones; 0 where it has none.
  std::uint64_t sequence = 0;
};

struct ExposureRange {
  double least_s = 0;
  double most_s = 0;
};

/// What starts an exposure.
enum class Trigger : std::uint8_t {
  kFree,      ///< the camera runs; a grab takes the first picture that begins after the call
  kSoftware,  ///< the grab
  kHardware,  ///< a signal on the camera's input
};

/// The camera HAL. One thread.
class Camera {
 public:
  virtual ~Camera() = default;
  /// For logs and texts: driver, make, serial number.
  [[nodiscard]] virtual std::string description() const = 0;
  [[nodiscard]] virtual int width() const = 0;
  [[nodiscard]] virtual int height() const = 0;
  /// Takes effect with the next grab. A device may round it; CameraFrame::exposure_s says to what.
  /// Errors: kInvalidOption (out of the camera's range, which is named).
  [[nodiscard]] virtual Status set_exposure(double seconds) = 0;
  [[nodiscard]] virtual ExposureRange exposure_range() const = 0;
  /// Errors: kInvalidOption (out of its range, which is named), kUnavailable (it has no such knob).
  [[nodiscard]] virtual Status set_gain_db(double gain);
  /// The camera's own names, its present one first; empty where there is no choice.
  [[nodiscard]] virtual std::vector<std::string> pixel_formats() const { return {}; }
  /// Errors: kInvalidOption (naming those that there are), kUnavailable (no choice).
  [[nodiscard]] virtual Status set_pixel_format(std::string_view name);
  /// Errors: kUnavailable.
  [[nodiscard]] virtual Status set_trigger(Trigger trigger);
  /// One picture, exposed after the call began.
  /// Errors: kTimeout (try again), kDisconnected (open again), kBadFormat (a damaged picture: try
  /// again).
  [[nodiscard]] virtual Result<CameraFrame> grab() = 0;
};

}  // namespace veneer::capture
