// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/stokes_image.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string>

#include "base/image_files.h"
#include "base/random.h"
#include "capture/polarisation/mueller.h"
#include "capture/polarisation/stokes.h"

namespace veneer::capture {
namespace {

using std::numbers::pi;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A mosaic that looks at even light.
Image<Rgb32f> mosaic_of(const Stokes& light, double extinction, int size) {
  // Rows of a cell: 90, 45; 135, 0 degrees.
  constexpr std::array<double, 4> kAngles{pi / 2, pi / 4, 3 * pi / 4, 0};
  Image<Rgb32f> picture(size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const double angle = kAngles[static_cast<std::size_t>(2 * (y % 2) + x % 2)];
      const double reading = (polariser(angle, extinction) * light)[0];
      picture(x, y).setConstant(static_cast<float>(reading));
    }
  }
  return picture;
}

TEST(StokesImage, ShowsTheLightThatAMosaicLooksAt) {
  for (const double extinction : {20.0, kInfinity}) {
    for (const double degree : {0.0, 0.3, 0.95}) {
      for (double angle = 0; angle < pi; angle += 0.4) {
        const Stokes light =
            100 * (degree * polarised_light(angle) + (1 - degree) * Stokes(1, 0, 0, 0));
        const Image<Rgb32f> picture = mosaic_of(light, extinction, 8);
        for (const auto& cells : {mosaic_cells(picture, 1000, Mosaic::kPolarMono),
                                  demosaic(picture, 1000, Mosaic::kPolarMono),
                                  mosaic_cells(picture, 1000, Mosaic::kPolarColour),
                                  demosaic(picture, 1000, Mosaic::kPolarColour)}) {
          ASSERT_TRUE(cells);
          const auto image = stokes_image(*cells, extinction);
          ASSERT_TRUE(image);
          // Floats of 100: about 1e-5.
          for (int channel = 0; channel < 3; ++channel) {
            EXPECT_NEAR(image->s0(1, 0)[channel], light[0], 1e-4);
            EXPECT_NEAR(image->s1(1, 0)[channel], light[1], 1e-4);
            EXPECT_NEAR(image->s2(1, 0)[channel], light[2], 1e-4);
            EXPECT_NEAR(image->redundancy(1, 0)[channel], 0, 1e-4);
          }
          const PolarisationSummary summary = summarise(*image, 40);
          EXPECT_EQ(summary.cells_used, image->saturated.pixels().size());
          EXPECT_NEAR(summary.dolp_p50, degree, 1e-6);
          EXPECT_NEAR(summary.dolp_p999, degree, 1e-6);
        }
      }
    }
  }
}

TEST(StokesImage, LeavesOutWhatIsSaturatedOrDark) {
  // Even unpolarised light; one cell is clipped at one angle, one is dark and looks polarised.
  Image<Rgb32f> picture = mosaic_of({100, 0, 0, 0}, kInfinity, 8);
  picture(0, 0).setConstant(255);
  for (int i = 0; i < 4; ++i) picture(2 + i % 2, i / 2).setConstant(0);
  picture(2, 0).setConstant(30);
  const auto cells = mosaic_cells(picture, 255, Mosaic::kPolarMono);
  ASSERT_TRUE(cells);
  const auto image = stokes_image(*cells, kInfinity);
  ASSERT_TRUE(image);
  const PolarisationSummary summary = summarise(*image, 40);
  EXPECT_EQ(summary.cells_used, 14U);
  EXPECT_EQ(summary.saturated_fraction, 1.0 / 16);
  EXPECT_NEAR(summary.dolp_p999, 0, 1e-9);
  EXPECT_GT(summarise(*image, 0).dolp_p999, 0.5);  // the dark one
}

TEST(StokesImage, OfNoUsableCellHasNoFigures) {
  const auto dark = mosaic_cells(Image<Rgb32f>(4, 4), 255, Mosaic::kPolarMono);
  ASSERT_TRUE(dark);
  const auto image = stokes_image(*dark, kInfinity);
  ASSERT_TRUE(image);
  for (const double least : {40.0, 0.0}) {
    const PolarisationSummary summary = summarise(*image, least);
    EXPECT_EQ(summary.cells_used, 0U);
    EXPECT_EQ(summary.dolp_p95, 0);
    EXPECT_EQ(summary.residual_median, 0);
  }
  EXPECT_EQ(summarise(StokesImage{}, 40).saturated_fraction, 0);
  EXPECT_FALSE(stokes_image(*dark, 1));
}

/// Figures of a real mosaic that were found apart from this code.
struct Checked {
  std::string name;
  double p50, p95, p999, residual, saturated;
};

class RealMosaic : public ::testing::TestWithParam<Checked> {};

TEST_P(RealMosaic, GivesTheFiguresThatWereChecked) {
  const Checked& checked = GetParam();
  const char* data = std::getenv("VENEER_DATA");
  const std::filesystem::path path = std::filesystem::path(data != nullptr ? data : "") /
                                     "polarsens" / (checked.name + "_IMX250MZR.png");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "real data absent: " << path;
  const auto pixels = read_png16(path);
  ASSERT_TRUE(pixels) << pixels.error().what;
  Image<Rgb32f> counts(pixels->width(), pixels->height());
  std::size_t clipped_cells = 0;
  for (int y = 0; y < counts.height(); ++y) {
    for (int x = 0; x < counts.width(); ++x)
      counts(x, y).setConstant(static_cast<float>((*pixels)(x, y)[0]) / 257.0F);
  }
  const auto cells = mosaic_cells(counts, 255, Mosaic::kPolarMono);
  ASSERT_TRUE(cells);
  for (int y = 0; y < cells->saturated.height(); ++y) {
    for (int x = 0; x < cells->saturated.width(); ++x) {
      bool clipped = false;
      for (int i = 0; i < 4; ++i)
        clipped = clipped || (*pixels)(2 * x + i % 2, 2 * y + i / 2)[0] == 65535;
      ASSERT_EQ(cells->saturated(x, y) != 0, clipped) << x << ", " << y;
      clipped_cells += clipped ? 1 : 0;
    }
  }
  const auto image = stokes_image(*cells, kInfinity);
  ASSERT_TRUE(image);
  const PolarisationSummary summary = summarise(*image, 40);
  // Half of the last digit that was written down.
  EXPECT_NEAR(summary.dolp_p50, checked.p50, 0.0005);
  EXPECT_NEAR(summary.dolp_p95, checked.p95, 0.0005);
  EXPECT_NEAR(summary.dolp_p999, checked.p999, 0.0005);
  EXPECT_NEAR(summary.residual_median, checked.residual, 0.00005);
  EXPECT_NEAR(summary.saturated_fraction, checked.saturated, 0.0005);
  EXPECT_EQ(
      summary.saturated_fraction,
      static_cast<double>(clipped_cells) / static_cast<double>(cells->saturated.pixels().size()));
}

INSTANTIATE_TEST_SUITE_P(Polarsens,
                         RealMosaic,
                         ::testing::Values(Checked{"camera", .026, .430, .831, -.0209, .013},
                                           Checked{"fruits", .079, .253, .477, -.0206, .0}),
                         [](const auto& mosaic) { return mosaic.param.name; });

}  // namespace
}  // namespace veneer::capture
