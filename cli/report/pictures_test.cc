// SPDX-License-Identifier: Apache-2.0
#include "cli/report/pictures.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/colour.h"

namespace veneer::cli {
namespace {

TEST(PictureOfXyz, ShowsTheWhiteAsWhiteAndCutsWhatIsBrighter) {
  const Xyz white = 400 * (xyz_from_srgb() * Eigen::Vector3d::Ones());
  Image<Rgb32f> xyz(3, 1);
  xyz(1, 0) = white.cast<float>();
  xyz(2, 0) = (3 * white).cast<float>();
  const Image<Rgb8> picture = picture_of_xyz(xyz.view(), 400);
  EXPECT_EQ(picture(0, 0), (Rgb8{0, 0, 0}));
  EXPECT_EQ(picture(1, 0), (Rgb8{255, 255, 255}));
  EXPECT_EQ(picture(2, 0), (Rgb8{255, 255, 255}));
}

TEST(PictureOfCodes, SpreadsAnyDepthOverEightBits) {
  const Image<Rgb16> ten(1, 1, Rgb16{1023, 514, 1});
  EXPECT_EQ(picture_of_codes(ten.view(), 10)(0, 0), (Rgb8{255, 128, 0}));
  const Image<Rgb16> eight(1, 1, Rgb16{255, 77, 0});
  EXPECT_EQ(picture_of_codes(eight.view(), 8)(0, 0), (Rgb8{255, 77, 0}));
  const Image<Rgb16> one(1, 1, Rgb16{1, 0, 1});
  EXPECT_EQ(picture_of_codes(one.view(), 1)(0, 0), (Rgb8{255, 0, 255}));
}

TEST(PictureOfDifferences, GrowsLighterWithTheDifference) {
  Image<float> de(16, 1);
  for (int x = 0; x < 16; ++x) de(x, 0) = static_cast<float>(x) / 3;
  const Image<Rgb8> picture = picture_of_differences(de.view(), 5);
  const auto lightness = [](const Rgb8& c) { return 0.21 * c[0] + 0.72 * c[1] + 0.07 * c[2]; };
  for (int x = 1; x < 16; ++x)
    EXPECT_GT(lightness(picture(x, 0)), lightness(picture(x - 1, 0))) << x;
}

TEST(PictureOfDifferences, MarksWhatIsNotCounted) {
  const Image<float> de(1, 1, std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(picture_of_differences(de.view(), 5)(0, 0), (Rgb8{70, 70, 70}));
}

}  // namespace
}  // namespace veneer::cli
