// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/image.h"

namespace veneer::projector {

/// The code of `to` bits that stands for the same fraction of full drive as a code of `from` bits:
/// round(code (2^to - 1) / (2^from - 1)), halves upwards. Exact at both ends, and different codes
/// stay different where `to` is at least `from`.
[[nodiscard]] constexpr std::uint32_t widen_code(std::uint32_t code, int from, int to) {
  const std::uint32_t full_from = (1U << static_cast<unsigned>(from)) - 1;
  const std::uint32_t full_to = (1U << static_cast<unsigned>(to)) - 1;
  return (2 * code * full_to + full_from) / (2 * full_from);
}

/// Packs codes of `bits` bits into words of `channel_bits` (8: XRGB8888, 10: XRGB2101010), widened
/// where they are narrower. A code beyond its bits is a bug and becomes the largest one: it must
/// not run into the neighbouring channel. Writes in order and reads nothing back, since a display's
/// memory may not be cached.
/// @param bits    1 to channel_bits.
/// @param words   as large as `codes`; its stride is in words.
void write_pixels(ImageView<const Rgb16> codes,
                  int bits,
                  int channel_bits,
                  ImageView<std::uint32_t> words);

}  // namespace veneer::projector
