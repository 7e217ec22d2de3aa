// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/pixels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace veneer::projector {
namespace {

TEST(WidenCode, IsTheNearestFraction) {
  for (const int to : {8, 10}) {
    for (int from = 1; from <= to; ++from) {
      const double full_from = std::pow(2.0, from) - 1;
      const double full_to = std::pow(2.0, to) - 1;
      for (std::uint32_t code = 0; code <= static_cast<std::uint32_t>(full_from); ++code)
        EXPECT_EQ(widen_code(code, from, to), std::floor(code * full_to / full_from + 0.5))
            << code << " of " << from << " to " << to;
    }
  }
}

TEST(WidenCode, CanBeUndone) {
  for (std::uint32_t code = 0; code < 256; ++code)
    EXPECT_EQ(widen_code(widen_code(code, 8, 10), 10, 8), code);
}

/// Every code in every channel once, the others random, and rows that are padded on both sides.
TEST(WritePixels, PutsEveryCodeInItsPlace) {
  constexpr int kHeight = 3;
  constexpr std::uint32_t kUntouched = 0xa5a5a5a5;
  for (const int channel_bits : {8, 10}) {
    for (int bits = 1; bits <= channel_bits; ++bits) {
      const int width = (1 << bits) + 5;
      Pcg32 random(static_cast<std::uint64_t>(bits));
      Image<Rgb16> codes(width + 3, kHeight);
      for (Rgb16& pixel : codes.pixels()) {
        for (std::uint16_t& code : pixel)
          code = static_cast<std::uint16_t>(random.next() % (1U << static_cast<unsigned>(bits)));
      }
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < 1 << bits; ++x)
          codes(x, y)[static_cast<std::size_t>(y)] = static_cast<std::uint16_t>(x);
      }
      const int stride = width + 7;
      std::vector<std::uint32_t> words(static_cast<std::size_t>(stride * kHeight), kUntouched);
      write_pixels({&codes(0, 0), width, kHeight, codes.width()},
                   bits,
                   channel_bits,
                   {words.data(), width, kHeight, stride});
      const auto shift = static_cast<unsigned>(channel_bits);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < stride; ++x) {
          const std::uint32_t word = words[static_cast<std::size_t>(y * stride + x)];
          if (x >= width) {
            ASSERT_EQ(word, kUntouched) << x << ", " << y;
            continue;
          }
          const Rgb16& code = codes(x, y);
          ASSERT_EQ(word,
                    (widen_code(code[0], bits, channel_bits) << (2 * shift)) |
                        (widen_code(code[1], bits, channel_bits) << shift) |
                        widen_code(code[2], bits, channel_bits))
              << bits << " to " << channel_bits << " at " << x << ", " << y;
        }
      }
    }
  }
}

TEST(WritePixels, ACodeBeyondItsBitsStaysInItsChannel) {
  Image<Rgb16> codes(1, 1);
  for (const int channel_bits : {8, 10}) {
    for (const int bits : {4, 8, 10}) {
      if (bits > channel_bits) continue;
      codes(0, 0) = {0, 65535, 0};
      std::uint32_t word = 0;
      write_pixels(codes.view(), bits, channel_bits, {&word, 1, 1, 1});
      const auto shift = static_cast<unsigned>(channel_bits);
      EXPECT_EQ(word, ((1U << shift) - 1) << shift) << bits;
    }
  }
}

TEST(WritePixels, AnEmptyPictureWritesNothing) {
  const Image<Rgb16> codes(1, 1);
  std::uint32_t word = 17;
  write_pixels({}, 8, 8, {});
  write_pixels({codes.view().data(), 0, 0, 1}, 8, 8, {&word, 0, 0, 1});
  EXPECT_EQ(word, 17U);
}

}  // namespace
}  // namespace veneer::projector
