// SPDX-License-Identifier: Apache-2.0
#include "base/colour.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace veneer {
namespace {

constexpr double kRounding = 1e-12;

TEST(SrgbMatrix, SendsWhiteToD65) {
  const Xyz white = xyz_from_srgb() * Eigen::Vector3d::Ones();
  EXPECT_NEAR(white.y(), 1.0, kRounding);
  EXPECT_NEAR(white.x() / white.sum(), 0.3127, kRounding);
  EXPECT_NEAR(white.y() / white.sum(), 0.3290, kRounding);
}

TEST(SrgbMatrix, AgreesWithTheStandardsFourDigits) {
  // IEC 61966-2-1 prints the matrix to four digits.
  constexpr double kPrinted = 6e-5;
  Eigen::Matrix3d printed;
  printed << 0.4124, 0.3576, 0.1805, 0.2126, 0.7152, 0.0722, 0.0193, 0.1192, 0.9505;
  EXPECT_LT((xyz_from_srgb() - printed).cwiseAbs().maxCoeff(), kPrinted);
}

TEST(SrgbTransfer, RoundTripsInAndOutOfRange) {
  for (double linear = -0.5; linear <= 2.0; linear += 0.001) {
    // The standard's two pieces meet to within 1e-8 only, so values between them come back shifted.
    EXPECT_NEAR(srgb_decode(srgb_encode(linear)), linear, 1e-7) << linear;
  }
  EXPECT_EQ(srgb_encode(0.0), 0.0);
  EXPECT_NEAR(srgb_encode(1.0), 1.0, kRounding);
}

TEST(Lab, OfTheWhiteIsOneHundred) {
  const Xyz white(500, 520, 600);
  const Lab lab = lab_from_xyz(white, white);
  EXPECT_NEAR(lab.l, 100, 1e-9);
  EXPECT_NEAR(lab.a, 0, 1e-9);
  EXPECT_NEAR(lab.b, 0, 1e-9);
}

TEST(Lab, IsNotCutAboveTheWhite) {
  const Xyz white(95, 100, 108);
  EXPECT_NEAR(lab_from_xyz(2 * white, white).l, 116 * std::cbrt(2.0) - 16, 1e-9);
}

TEST(Lab, IsFiniteForBlackAndBelow) {
  const Xyz white(95, 100, 108);
  EXPECT_NEAR(lab_from_xyz(Xyz::Zero(), white).l, 0, 1e-9);
  EXPECT_TRUE(std::isfinite(lab_from_xyz(Xyz(-1, -1, -1), white).l));
}

struct SharmaPair {
  Lab a;
  Lab b;
  double difference;
};
// Sharma, Wu, Dalal 2005, "The CIEDE2000 Color-Difference Formula: Implementation Notes,
// Supplementary Test Data, and Mathematical Observations", Table 1, rows 1, 4, 7, 13, 17, 20,
// 25, 31.
constexpr std::array kSharma{
    SharmaPair{{50, 2.6772, -79.7751}, {50, 0, -82.7485}, 2.0425},
    SharmaPair{{50, -1.3802, -84.2814}, {50, 0, -82.7485}, 1.0000},
    SharmaPair{{50, 0, 0}, {50, -1, 2}, 2.3669},
    SharmaPair{{50, -0.0010, 2.4900}, {50, 0.0009, -2.4900}, 4.8045},
    SharmaPair{{50, 2.5, 0}, {73, 25, -18}, 27.1492},
    SharmaPair{{50, 2.5, 0}, {58, 24, 15}, 19.4535},
    SharmaPair{{60.2574, -34.0099, 36.2677}, {60.4626, -34.1751, 39.4387}, 1.2644},
    SharmaPair{{22.7233, 20.0904, -46.6940}, {23.0331, 14.9730, -42.5619}, 2.0373},
};

TEST(DeltaE2000, GivesThePublishedTestData) {
  constexpr double kPrinted = 5e-5;  // the table has four decimals
  for (const SharmaPair& pair : kSharma) {
    EXPECT_NEAR(delta_e_2000(pair.a, pair.b), pair.difference, kPrinted)
        << pair.a.l << " " << pair.a.a;
    EXPECT_NEAR(delta_e_2000(pair.b, pair.a), pair.difference, kPrinted) << "the other way round";
  }
}

}  // namespace
}  // namespace veneer
