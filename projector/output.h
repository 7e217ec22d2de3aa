// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "base/clock.h"
#include "base/image.h"
#include "base/result.h"

namespace veneer::projector {

/// A finished frame on its way to the projector.
struct Frame {
  std::uint64_t number = 0;
  /// Drive values as code values of `bits` bits, in the low bits; first row on top.
  ImageView<const Rgb16> codes;
  int bits = 8;
  /// Luminance target before compensation, XYZ in cd/m^2; empty unless the output wants it.
  ImageView<const Rgb32f> target_xyz;
  /// When it is meant to be seen.
  Time display_time;
};

/// What the picture goes to: a file, a window, a scan-out engine. Used by one thread.
class Output {
 public:
  virtual ~Output() = default;
  [[nodiscard]] virtual std::string description() const = 0;
  /// Whether present() wants the pixels of the frame of this number; reading them back from the GPU
  /// costs time. Always the same answer for the same number.
  [[nodiscard]] virtual bool wants_pixels(std::uint64_t frame_number) const = 0;
  /// Whether it also wants its Frame::target_xyz; only where it wants its pixels.
  [[nodiscard]] virtual bool wants_target(std::uint64_t /*frame_number*/) const { return false; }
  /// Hands over one frame; views that are not wanted may be empty. Errors: kIo.
  [[nodiscard]] virtual Status present(const Frame& frame) = 0;
  /// After the last frame: waits until all is out.
  [[nodiscard]] virtual Status finish() { return {}; }
  /// How often present() has had to wait because the output could not keep up.
  [[nodiscard]] virtual std::uint64_t waits() const { return 0; }
};

}  // namespace veneer::projector
