// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/aravis/pixel_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace veneer::capture {
namespace {

using ::testing::HasSubstr;

/// Writes samples as the format lays them out, from its definition: bit by bit.
std::vector<std::byte> packed(const std::vector<std::uint16_t>& samples,
                              const PixelFormat& format) {
  std::vector<std::byte> bytes(2 * samples.size() + 3);
  std::size_t used = 0;
  const auto put = [&](std::size_t byte, unsigned bit, unsigned value) {
    bytes[byte] |= static_cast<std::byte>(value << bit);
    used = std::max(used, byte + 1);
  };
  const auto bits = static_cast<std::size_t>(format.bits);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    for (std::size_t b = 0; b < bits; ++b) {
      const unsigned bit = samples[i] >> b & 1U;
      const std::size_t low = bits - 8;  // of "Packed": the bits in the middle byte
      switch (format.packing) {
        case PixelFormat::Packing::kBytes:
          put(i, static_cast<unsigned>(b), bit);
          break;
        case PixelFormat::Packing::kWords:
          put(2 * i + b / 8, static_cast<unsigned>(b % 8), bit);
          break;
        case PixelFormat::Packing::kBits:
          put((i * bits + b) / 8, static_cast<unsigned>((i * bits + b) % 8), bit);
          break;
        case PixelFormat::Packing::kPairs:
          if (b >= low) {
            put(i / 2 * 3 + i % 2 * 2, static_cast<unsigned>(b - low), bit);
          } else {
            put(i / 2 * 3 + 1, static_cast<unsigned>(b + i % 2 * 4), bit);
          }
          break;
      }
    }
  }
  bytes.resize(used);
  return bytes;
}

TEST(PixelFormat, EveryGreyFormatGivesBackWhatWasPacked) {
  constexpr int kWidth = 5;  // odd: rows of packed formats end inside a byte
  constexpr int kHeight = 4;
  std::mt19937 random(7);
  for (const std::string depth :
       {"8", "10", "12", "14", "16", "10p", "12p", "14p", "10Packed", "12Packed"}) {
    for (const std::string family : {"Mono", "Polarized", "BayerRGPolarized"}) {
      const auto format = pixel_format_named(family + depth);
      ASSERT_TRUE(format) << family << depth;
      std::vector<std::uint16_t> samples(kWidth * kHeight);
      for (std::uint16_t& each : samples) {
        each = static_cast<std::uint16_t>(random() & format->full_scale());
      }
      samples.front() = format->full_scale();
      samples.back() = format->full_scale();
      const std::vector<std::byte> bytes = packed(samples, *format);
      const auto counts = counts_of(bytes, *format, kWidth, kHeight, 0);
      ASSERT_TRUE(counts) << family << depth << ": " << counts.error().what;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        ASSERT_EQ(counts->pixels()[i], (Rgb16{samples[i], samples[i], samples[i]}))
            << family << depth << " sample " << i;
      }
      const auto short_by_one =
          counts_of(std::span(bytes).first(bytes.size() - 1), *format, kWidth, kHeight, 0);
      ASSERT_FALSE(short_by_one) << family << depth;
      EXPECT_EQ(short_by_one.error().code, Errc::kBadFormat);
    }
  }
}

TEST(PixelFormat, TwelveBitsAreLaidOutAsTheStandardsDraw) {
  // Two pixels, 0xABC and 0x123.
  const std::vector<std::byte> p{std::byte{0xBC}, std::byte{0x3A}, std::byte{0x12}};
  const std::vector<std::byte> pairs{std::byte{0xAB}, std::byte{0x3C}, std::byte{0x12}};
  EXPECT_EQ(counts_of(p, *pixel_format_named("Mono12p"), 2, 1, 0).value()(0, 0)[0], 0xABC);
  EXPECT_EQ(counts_of(p, *pixel_format_named("Mono12p"), 2, 1, 0).value()(1, 0)[0], 0x123);
  EXPECT_EQ(counts_of(pairs, *pixel_format_named("Mono12Packed"), 2, 1, 0).value()(0, 0)[0], 0xABC);
  EXPECT_EQ(counts_of(pairs, *pixel_format_named("Mono12Packed"), 2, 1, 0).value()(1, 0)[0], 0x123);
}

TEST(PixelFormat, PaddingAfterARowIsSkipped) {
  const std::vector<std::byte> bytes{
      std::byte{1}, std::byte{2}, std::byte{99}, std::byte{3}, std::byte{4}};
  const auto counts = counts_of(bytes, *pixel_format_named("Mono8"), 2, 2, 1);
  ASSERT_TRUE(counts) << counts.error().what;
  EXPECT_EQ((*counts)(1, 0)[0], 2);
  EXPECT_EQ((*counts)(0, 1)[0], 3);
}

TEST(PixelFormat, ColoursOfAPixelStayInTheirOrder) {
  const std::vector<std::byte> bytes{std::byte{10}, std::byte{20}, std::byte{30}};
  EXPECT_EQ(counts_of(bytes, *pixel_format_named("RGB8"), 1, 1, 0).value()(0, 0),
            (Rgb16{10, 20, 30}));
}

/// A Bayer picture of light whose colours are the same everywhere, or linear in space.
std::vector<std::uint16_t> bayer_picture(const std::string& order,
                                         int size,
                                         const std::array<std::array<int, 3>, 3>& plane) {
  std::vector<std::uint16_t> samples;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const char colour = order[static_cast<std::size_t>(2 * (y % 2) + x % 2)];
      const auto& p = plane[colour == 'R' ? 0 : colour == 'G' ? 1 : 2];
      samples.push_back(static_cast<std::uint16_t>(p[0] + p[1] * x + p[2] * y));
    }
  }
  return samples;
}

TEST(PixelFormat, InterpolatedColoursOfLinearLightAreExact) {
  constexpr int kSize = 8;
  // Even slopes, so that means of neighbours are whole numbers.
  const std::array<std::array<int, 3>, 3> plane{{{400, 20, 4}, {1000, -8, 12}, {90, 2, 30}}};
  const std::array<std::pair<std::string, std::string>, 4> orders{
      {{"BayerRG12", "RGGB"}, {"BayerGR12", "GRBG"}, {"BayerGB12", "GBRG"}, {"BayerBG12", "BGGR"}}};
  for (const auto& [name, order] : orders) {
    const auto format = pixel_format_named(name);
    ASSERT_TRUE(format);
    const auto counts =
        counts_of(packed(bayer_picture(order, kSize, plane), *format), *format, kSize, kSize, 0);
    ASSERT_TRUE(counts) << counts.error().what;
    // The outermost pixels lack neighbours.
    for (int y = 1; y < kSize - 1; ++y) {
      for (int x = 1; x < kSize - 1; ++x) {
        for (std::size_t c = 0; c < 3; ++c) {
          EXPECT_EQ((*counts)(x, y)[c], plane[c][0] + plane[c][1] * x + plane[c][2] * y)
              << name << " at " << x << ", " << y << " channel " << c;
        }
      }
    }
    const auto flat = counts_of(
        packed(bayer_picture(order, kSize, {{{4095, 0, 0}, {7, 0, 0}, {0, 0, 0}}}), *format),
        *format,
        kSize,
        kSize,
        0);
    for (const Rgb16& pixel : flat.value().pixels()) EXPECT_EQ(pixel, (Rgb16{4095, 7, 0})) << name;
  }
}

TEST(PixelFormat, APatternNeedsAWholeCell) {
  const std::vector<std::byte> bytes(8);
  EXPECT_THAT(counts_of(bytes, *pixel_format_named("BayerRG8"), 4, 1, 0).error().what,
              HasSubstr("4 x 1"));
  EXPECT_FALSE(counts_of(bytes, *pixel_format_named("Mono8"), 0, 4, 0));
  EXPECT_FALSE(counts_of(bytes, *pixel_format_named("Mono8"), 4, -1, 0));
}

TEST(PixelFormat, NamesSayDepthAndAnalysers) {
  EXPECT_EQ(pixel_format_named("Mono8")->full_scale(), 255);
  EXPECT_EQ(pixel_format_named("Mono12p")->full_scale(), 4095);
  EXPECT_EQ(pixel_format_named("BayerRG16")->full_scale(), 65535);
  EXPECT_EQ(pixel_format_named("Polarized12p")->mosaic, Mosaic::kPolarMono);
  EXPECT_EQ(pixel_format_named("BayerRGPolarized8")->mosaic, Mosaic::kPolarColour);
  // Not linear, not known to the letter, or several pictures in one.
  for (const std::string other : {"",
                                  "Mono",
                                  "Mono9",
                                  "Mono8s",
                                  "mono8",
                                  "YUV422_8",
                                  "BGR8",
                                  "BayerRG",
                                  "PolarizedAngles_0d_45d_90d_135d_Mono8"}) {
    EXPECT_FALSE(pixel_format_named(other)) << other;
  }
}

}  // namespace
}  // namespace veneer::capture
