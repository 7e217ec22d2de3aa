// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/gphoto2/raw_picture.h"

#include <gtest/gtest.h>

#include <random>

#include "capture/testing/dng.h"

namespace veneer::capture {
namespace {

using testing::bayer_dng;

constexpr std::uint16_t kWhite = 16383;

std::size_t colour_of(int x, int y) { return static_cast<std::size_t>(x % 2 + y % 2); }

TEST(DecodeRaw, GivesEveryPixelsOwnCountExactly) {
  Image<std::uint16_t> mosaic(64, 48);
  std::mt19937 random(20);
  for (auto& count : mosaic.pixels()) count = static_cast<std::uint16_t>(random() % kWhite);
  const auto picture = decode_raw(bayer_dng(mosaic, kWhite), "test.dng");
  ASSERT_TRUE(picture) << picture.error().what;
  ASSERT_EQ(picture->counts.width(), 64);
  ASSERT_EQ(picture->counts.height(), 48);
  EXPECT_EQ(picture->full_scale, kWhite);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      ASSERT_EQ(picture->counts(x, y)[colour_of(x, y)], mosaic(x, y)) << x << ", " << y;
    }
  }
}

TEST(DecodeRaw, InterpolatesARampExactlyInside) {
  // Bilinear interpolation gives back what is linear in space. Even coefficients: every mean is a
  // whole number.
  Image<std::uint16_t> mosaic(64, 48);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) mosaic(x, y) = static_cast<std::uint16_t>(100 + 20 * x + 12 * y);
  }
  const auto picture = decode_raw(bayer_dng(mosaic, kWhite), "test.dng");
  ASSERT_TRUE(picture) << picture.error().what;
  for (int y = 1; y < 47; ++y) {
    for (int x = 1; x < 63; ++x) {
      for (const std::uint16_t count : picture->counts(x, y)) {
        ASSERT_EQ(count, mosaic(x, y)) << x << ", " << y;
      }
    }
  }
}

TEST(DecodeRaw, KeepsColoursApart) {
  Image<std::uint16_t> mosaic(64, 48);
  const Rgb16 light{1000, 2000, 3000};
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) mosaic(x, y) = light[colour_of(x, y)];
  }
  const auto picture = decode_raw(bayer_dng(mosaic, kWhite), "test.dng");
  ASSERT_TRUE(picture) << picture.error().what;
  for (const Rgb16& pixel : picture->counts.pixels()) ASSERT_EQ(pixel, light);
}

TEST(DecodeRaw, SpreadsSaturationToAllThatUsesIt) {
  Image<std::uint16_t> mosaic(64, 48, 500);
  mosaic(20, 20) = kWhite;  // red
  const auto picture = decode_raw(bayer_dng(mosaic, kWhite), "test.dng");
  ASSERT_TRUE(picture) << picture.error().what;
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool near = std::abs(x - 20) <= 1 && std::abs(y - 20) <= 1;
      ASSERT_EQ(picture->counts(x, y)[0], near ? kWhite : 500) << x << ", " << y;
      ASSERT_EQ(picture->counts(x, y)[2], 500) << x << ", " << y;
    }
  }
}

TEST(DecodeRaw, RefusesWhatIsDamaged) {
  const std::string whole = bayer_dng(Image<std::uint16_t>(64, 48, 500), kWhite);
  std::vector<std::string> damaged{"",
                                   "no picture",
                                   std::string(10000, '\0'),
                                   whole.substr(0, 100),
                                   whole.substr(0, whole.size() / 2),
                                   whole.substr(0, whole.size() - 1000)};
  for (const std::string& bytes : damaged) {
    const auto picture = decode_raw(bytes, "test.dng");
    ASSERT_FALSE(picture) << bytes.size();
    EXPECT_EQ(picture.error().code, Errc::kBadFormat);
    EXPECT_NE(picture.error().what.find("test.dng"), std::string::npos);
  }
}

}  // namespace
}  // namespace veneer::capture
