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
  /// Luminance target before compensation, XYZ in cd/m^2; empty unless the output asked for it.
  ImageView<const Rgb32f> target_xyz;
  /// When it is meant to be seen.
  Time display_time;
};

/// What the picture goes to: a file, a window, a scan-out engine. Used by one thread.
class Output {
 public:
  virtual ~Output() = default;
  [[nodiscard]] virtual std::string description() const = 0;
  /// Whether present() wants pixels at all; reading them back from the GPU costs time.
  [[nodiscard]] virtual bool wants_pixels() const = 0;
  /// Whether it also wants Frame::target_xyz.
  [[nodiscard]] virtual bool wants_target() const { return false; }
  /// Hands over one frame. Errors: kIo.
  [[nodiscard]] virtual Status present(const Frame& frame) = 0;
  /// After the last frame: waits until all is out.
  [[nodiscard]] virtual Status finish() { return {}; }
  /// How often present() has had to wait because the output could not keep up.
  [[nodiscard]] virtual std::uint64_t waits() const { return 0; }
};

}  // namespace veneer::projector
