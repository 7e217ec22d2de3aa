// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/mosaic.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>

#include "base/random.h"

namespace veneer::capture {
namespace {

constexpr double kFullScale = 4095;

/// Degrees of the analyser of a pixel, from the description of the sensor: 90, 45; 135, 0.
int degrees_at(int x, int y) {
  constexpr std::array<std::array<int, 2>, 2> kCell{{{90, 45}, {135, 0}}};
  return kCell[static_cast<std::size_t>(y % 2)][static_cast<std::size_t>(x % 2)];
}
/// 0, 1, 2: the colour of a pixel of a colour mosaic, R G; G B of cells of 2 x 2.
int colour_at(int x, int y) { return (x / 2) % 2 + (y / 2) % 2; }

/// A plane of its own for every angle and colour.
double plane(int degrees, int colour, double x, double y) {
  return 500 + degrees + 100 * colour + (1 + degrees / 45) * 2.0 * x - (1 + colour) * 3.0 * y;
}

Image<Rgb32f> mosaic_of_planes(Mosaic mosaic, int width, int height) {
  Image<Rgb32f> picture(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int colour = mosaic == Mosaic::kPolarColour ? colour_at(x, y) : 0;
      picture(x, y).setConstant(static_cast<float>(plane(degrees_at(x, y), colour, x, y)));
    }
  }
  return picture;
}

struct Size {
  int width, height;
};

TEST(Demosaic, BringsPlanesBackExactlyWithTheirBorders) {
  for (const Mosaic mosaic : {Mosaic::kPolarMono, Mosaic::kPolarColour}) {
    for (const Size size : {Size{8, 8}, Size{20, 12}, Size{12, 20}}) {
      const auto cells =
          demosaic(mosaic_of_planes(mosaic, size.width, size.height), kFullScale, mosaic);
      ASSERT_TRUE(cells) << cells.error().what;
      for (int angle = 0; angle < 4; ++angle) {
        const Image<Rgb32f>& picture = cells->counts[static_cast<std::size_t>(angle)];
        ASSERT_EQ(picture.width(), size.width);
        ASSERT_EQ(picture.height(), size.height);
        for (int y = 0; y < size.height; ++y) {
          for (int x = 0; x < size.width; ++x) {
            for (int c = 0; c < 3; ++c) {
              const int colour = mosaic == Mosaic::kPolarColour ? c : 0;
              // All values and weights are small multiples of powers of one half: nothing rounds.
              ASSERT_EQ(picture(x, y)[c], plane(45 * angle, colour, x, y))
                  << "angle " << 45 * angle << " at " << x << ", " << y << " channel " << c;
            }
            ASSERT_EQ(cells->saturated(x, y), 0);
          }
        }
      }
    }
  }
}

TEST(Demosaic, KeepsWhatAPixelRead) {
  Pcg32 random(1);
  for (const Mosaic mosaic : {Mosaic::kPolarMono, Mosaic::kPolarColour}) {
    Image<Rgb32f> picture(16, 12);
    for (Rgb32f& pixel : picture.pixels())
      pixel.setConstant(static_cast<float>(std::floor(4000 * random.uniform())));
    const auto cells = demosaic(picture, kFullScale, mosaic);
    ASSERT_TRUE(cells);
    for (int y = 0; y < 12; ++y) {
      for (int x = 0; x < 16; ++x) {
        const auto angle = static_cast<std::size_t>(degrees_at(x, y) / 45);
        EXPECT_EQ(cells->counts[angle](x, y)[colour_at(x, y)], picture(x, y)[0]);
      }
    }
  }
}

TEST(Demosaic, SaturationSpreadsToWhatWasInterpolatedFromIt) {
  for (const Mosaic mosaic : {Mosaic::kPolarMono, Mosaic::kPolarColour}) {
    constexpr int kSize = 16;
    Image<Rgb32f> picture(kSize, kSize, Rgb32f::Constant(100));
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        Image<Rgb32f> clipped = picture;
        clipped(x, y).setConstant(static_cast<float>(kFullScale));
        const auto cells = demosaic(clipped, kFullScale, mosaic);
        ASSERT_TRUE(cells);
        // All else is constant, so a value that differs was made from the clipped one.
        for (int v = 0; v < kSize; ++v) {
          for (int u = 0; u < kSize; ++u) {
            bool touched = false;
            for (const Image<Rgb32f>& angle : cells->counts)
              touched = touched || (angle(u, v).array() != 100.0F).any();
            const bool masked = cells->saturated(u, v) != 0;
            ASSERT_TRUE(masked || !touched) << "clipped " << x << ", " << y << " seen at " << u
                                            << ", " << v << " of mosaic " << int(mosaic);
            // Where green is continued into a corner, weights may cancel, so that a pixel is masked
            // for nothing; but never far away.
            const int reach = std::max(std::abs(u - x), std::abs(v - y));
            ASSERT_TRUE(touched || !masked || (mosaic == Mosaic::kPolarColour && reach <= 4))
                << "clipped " << x << ", " << y << " masks " << u << ", " << v;
          }
        }
        EXPECT_EQ(cells->saturated(x, y), 1);
      }
    }
  }
}

TEST(Demosaic, TakesASingleCellForConstant) {
  const auto mono = demosaic(mosaic_of_planes(Mosaic::kPolarMono, 2, 2), 4095, Mosaic::kPolarMono);
  ASSERT_TRUE(mono);
  EXPECT_EQ(mono->counts[0](0, 0)[0], plane(0, 0, 1, 1));
  const auto colour =
      demosaic(mosaic_of_planes(Mosaic::kPolarColour, 4, 4), 4095, Mosaic::kPolarColour);
  ASSERT_TRUE(colour);
  EXPECT_EQ(colour->counts[0](0, 0)[0], plane(0, 0, 1, 1));
  // Two greens of the angle, at (3, 1) and (1, 3); (0, 0) lies one further out than their mean.
  EXPECT_TRUE(std::isfinite(colour->counts[0](0, 0)[1]));
}

TEST(MosaicCells, HoldTheReadingsOfTheirPixels) {
  const auto mono =
      mosaic_cells(mosaic_of_planes(Mosaic::kPolarMono, 8, 6), kFullScale, Mosaic::kPolarMono);
  ASSERT_TRUE(mono);
  ASSERT_EQ(mono->saturated.width(), 4);
  ASSERT_EQ(mono->saturated.height(), 3);
  const auto colour =
      mosaic_cells(mosaic_of_planes(Mosaic::kPolarColour, 8, 12), kFullScale, Mosaic::kPolarColour);
  ASSERT_TRUE(colour);
  ASSERT_EQ(colour->saturated.width(), 2);
  ASSERT_EQ(colour->saturated.height(), 3);
  // 45 degrees are on the right of the upper row.
  EXPECT_EQ(mono->counts[1](2, 1), Rgb32f::Constant(static_cast<float>(plane(45, 0, 5, 2))));
  const Rgb32f& cell = colour->counts[1](1, 2);
  EXPECT_EQ(cell[0], plane(45, 0, 5, 8));
  EXPECT_EQ(cell[1], 0.5 * (plane(45, 1, 7, 8) + plane(45, 1, 5, 10)));
  EXPECT_EQ(cell[2], plane(45, 2, 7, 10));
}

TEST(MosaicCells, OneClippedPixelMasksItsCellAlone) {
  for (const Mosaic mosaic : {Mosaic::kPolarMono, Mosaic::kPolarColour}) {
    const int size = mosaic == Mosaic::kPolarColour ? 4 : 2;
    for (const float bad : {4095.0F, 5000.0F, std::numeric_limits<float>::quiet_NaN()}) {
      for (int i = 0; i < size * size; ++i) {
        Image<Rgb32f> picture(3 * size, 2 * size, Rgb32f::Constant(4094.5F));
        picture(size + i % size, size + i / size).setConstant(bad);
        const auto cells = mosaic_cells(picture, kFullScale, mosaic);
        ASSERT_TRUE(cells);
        for (int y = 0; y < 2; ++y) {
          for (int x = 0; x < 3; ++x)
            EXPECT_EQ(cells->saturated(x, y), x == 1 && y == 1 ? 1 : 0) << bad << " pixel " << i;
        }
      }
    }
  }
}

TEST(MosaicCells, RefusesWhatIsNoWholeNumberOfCells) {
  const auto refused = [](int width, int height, Mosaic mosaic, const std::string& text) {
    const Image<Rgb32f> picture(width, height);
    for (const auto& result :
         {mosaic_cells(picture, 255, mosaic), demosaic(picture, 255, mosaic)}) {
      ASSERT_FALSE(result);
      EXPECT_EQ(result.error().code, Errc::kBadFormat);
      EXPECT_NE(result.error().what.find(text), std::string::npos) << result.error().what;
    }
  };
  refused(5, 4, Mosaic::kPolarMono, "5 x 4");
  refused(4, 5, Mosaic::kPolarMono, "4 x 5");
  refused(6, 4, Mosaic::kPolarColour, "cells of 4 x 4");
  refused(0, 0, Mosaic::kPolarMono, "0 x 0");
  refused(4, 4, Mosaic::kNone, "no analysers");
}

TEST(Mosaic, NamesAndAnglesAreThoseOfTheSensor) {
  ASSERT_TRUE(mosaic_named("polarsens-mono"));
  EXPECT_EQ(*mosaic_named("polarsens-mono"), Mosaic::kPolarMono);
  EXPECT_EQ(*mosaic_named("polarsens-colour"), Mosaic::kPolarColour);
  const auto unknown = mosaic_named("bayer");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, Errc::kInvalidOption);
  EXPECT_NE(unknown.error().what.find("polarsens-mono and polarsens-colour"), std::string::npos);
  for (int i = 0; i < 4; ++i)
    EXPECT_DOUBLE_EQ(mosaic_angles()[static_cast<std::size_t>(i)], i * std::numbers::pi / 4);
}

}  // namespace
}  // namespace veneer::capture
