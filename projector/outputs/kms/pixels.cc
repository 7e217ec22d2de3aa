// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/pixels.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/result.h"

namespace veneer::projector {
namespace {

/// @param widen  from a code that is not above `full` to one of kChannelBits.
template <int kChannelBits, class Widen>
void write_row(const std::uint16_t* __restrict codes,
               std::size_t pixels,
               std::uint16_t full,
               std::uint32_t* __restrict words,
               Widen widen) {
  for (std::size_t i = 0; i < pixels; ++i) {
    const std::uint32_t red = widen(std::min(codes[3 * i], full));
    const std::uint32_t green = widen(std::min(codes[3 * i + 1], full));
    const std::uint32_t blue = widen(std::min(codes[3 * i + 2], full));
    words[i] = (red << (2U * kChannelBits)) | (green << unsigned{kChannelBits}) | blue;
  }
}

template <int kChannelBits>
void write_all(ImageView<const Rgb16> codes, int bits, ImageView<std::uint32_t> words) {
  const auto full = static_cast<std::uint16_t>((1U << static_cast<unsigned>(bits)) - 1);
  const auto rows = [&](auto widen) {
    for (int y = 0; y < codes.height(); ++y)
      write_row<kChannelBits>(
          codes.row(y).data()->data(), codes.row(y).size(), full, words.row(y).data(), widen);
  };
  if (bits == kChannelBits) return rows([](std::uint16_t code) { return code; });
  if (bits == 8 && kChannelBits == 10) {
    // 1023/255 is 4 + 3/255, so that v/85, rounded, is left to add; v + 42 over 85 is 193/16384 of
    // it, cut off, for all codes, and stays in 16 bits: twice as many pixels at once.
    return rows([](std::uint16_t code) {
      const auto rest = static_cast<std::uint16_t>((code + 42U) * 193U);
      return static_cast<std::uint16_t>(4U * code + (rest >> 14U));
    });
  }
  std::array<std::uint32_t, 1U << unsigned{kChannelBits}> table{};
  for (std::uint32_t code = 0; code <= full; ++code)
    table[code] = widen_code(code, bits, kChannelBits);
  rows([&table](std::uint16_t code) { return table[code]; });
}

}  // namespace

void write_pixels(ImageView<const Rgb16> codes,
                  int bits,
                  int channel_bits,
                  ImageView<std::uint32_t> words) {
  static_assert(sizeof(Rgb16) == 3 * sizeof(std::uint16_t));
  VENEER_CHECK(bits >= 1 && bits <= channel_bits && (channel_bits == 8 || channel_bits == 10));
  VENEER_CHECK(codes.width() == words.width() && codes.height() == words.height());
  if (codes.empty()) return;
  if (channel_bits == 8) {
    write_all<8>(codes, bits, words);
  } else {
    write_all<10>(codes, bits, words);
  }
}

}  // namespace veneer::projector
