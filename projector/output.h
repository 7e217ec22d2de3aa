// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "base/clock.h"
#include "base/image.h"
#include "base/result.h"
#include "base/scanout.h"

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
  /// Which of Scanout::buffers holds it, for outputs that have them; no pixels then.
  std::optional<std::size_t> buffer;
};

/// A frame that was seen.
struct Presented {
  std::uint64_t number = 0;  ///< Frame::number
  Time time;                 ///< when its first line went out, by the display's own stamp
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
  /// Hands over one frame; views that are not wanted may be empty.
  /// Errors: kUnavailable (not now: unplugged, another program has the display; the frame is
  /// dropped, and later calls try again by themselves), kCancelled (somebody closed it), any other:
  /// open the output again.
  [[nodiscard]] virtual Status present(const Frame& frame) = 0;
  /// After the last frame: waits until all is out.
  [[nodiscard]] virtual Status finish() { return {}; }
  /// How often present() has had to wait because the output could not keep up.
  [[nodiscard]] virtual std::uint64_t waits() const { return 0; }

  /// Goes dark at once, without the GPU and without a frame, until the next present(). For when
  /// nothing can be drawn; outputs whose picture goes away by itself do nothing.
  [[nodiscard]] virtual Status blank() { return {}; }
  /// The newest frame that is known to have been seen; none from outputs that cannot know. Never
  /// waits.
  [[nodiscard]] virtual std::optional<Presented> last_presented() { return std::nullopt; }
  /// From one refresh of the display to the next; none where frames are taken at any time.
  [[nodiscard]] virtual std::optional<Duration> refresh_period() const { return std::nullopt; }

  /// Where the renderer is to draw the picture itself; null where pixels are wanted instead.
  [[nodiscard]] virtual const Scanout* scanout() const { return nullptr; }
  /// The buffer for the next frame, of Scanout::buffers. Waits until one is free: at most two
  /// refreshes. Errors as present().
  [[nodiscard]] virtual Result<std::size_t> next_buffer() {
    return fail(Errc::kUnavailable, "asking an output without buffers of its own for one");
  }
  /// The renderer cannot draw into the buffers: from now on pixels are wanted and scanout() is
  /// null.
  virtual void give_up_scanout() {}
};

}  // namespace veneer::projector
