// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/projector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using ::testing::HasSubstr;
using testing::plain_truth;

Eigen::Vector3d total(const Image<Rgb32f>& image) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Rgb32f& pixel : image.pixels()) sum += pixel.cast<double>();
  return sum;
}

TEST(VirtualProjector, TonesRiseFromZeroToOne) {
  ProjectorTruth truth = plain_truth().projector;
  truth.channels[0].exponent = 2.4;
  truth.channels[1] = {ChannelTruth::Tone::kSCurve, 0, 2.6, 2.4, 0.3, 535, 20, 1};
  const VirtualProjector projector(truth);
  Eigen::Vector3d previous = projector.output({0, 0, 0});
  EXPECT_TRUE(previous.isZero());
  for (std::uint16_t code = 1; code < 256; ++code) {
    const Eigen::Vector3d now = projector.output({code, code, code});
    EXPECT_GT((now - previous).minCoeff(), 0) << code;
    previous = now;
  }
  EXPECT_TRUE(previous.isApproxToConstant(1.0, 1e-12));
}

TEST(VirtualProjector, WhiteAndBlackHaveTheLuminanceAskedFor) {
  ProjectorTruth truth = plain_truth().projector;
  truth.leak = 0.05;
  truth.interaction = 0.1;
  truth.black_fraction = 0.002;
  const VirtualProjector projector(truth);
  const Eigen::Vector3d full = projector.output({255, 255, 255});
  Spectrum white = Spectrum::Zero();
  for (std::size_t c = 0; c < 3; ++c)
    white += full[static_cast<Eigen::Index>(c)] * projector.primaries()[c];
  EXPECT_NEAR(xyz_of(white).y(), 800, 1e-9);
  EXPECT_NEAR(xyz_of(projector.black()).y(), 1.6, 1e-9);
}

TEST(VirtualProjector, LeakMovesLightBetweenSpectraAndLosesNone) {
  ProjectorTruth truth = plain_truth().projector;
  const VirtualProjector pure(truth);
  truth.leak = 0.1;
  const VirtualProjector leaky(truth);
  for (std::size_t c = 0; c < 3; ++c) {
    const Spectrum expected = 0.8 * pure.primaries()[c] + 0.1 * pure.primaries()[(c + 1) % 3] +
                              0.1 * pure.primaries()[(c + 2) % 3];
    EXPECT_TRUE(leaky.primaries()[c].isApprox(expected, 1e-12)) << c;
  }
}

TEST(VirtualProjector, DriveTowardsUndoesTheInteraction) {
  ProjectorTruth truth = plain_truth().projector;
  truth.bits = 10;
  truth.interaction = 0.3;
  const VirtualProjector projector(truth);
  Pcg32 random(5);
  for (int trial = 0; trial < 200; ++trial) {
    Rgb16 code{};
    for (auto& value : code) value = static_cast<std::uint16_t>(1024 * random.uniform());
    const Eigen::Vector3d drive = projector.drive_towards(projector.output(code));
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(drive[c], code[static_cast<std::size_t>(c)] / 1023.0, 1e-9);
    EXPECT_TRUE(projector.interact(drive).isApprox(projector.output(code), 1e-9));
  }
}

TEST(VirtualProjector, DriveTowardsStaysWithinTheCubeAndKeepsNan) {
  ProjectorTruth truth = plain_truth().projector;
  truth.interaction = 0.3;
  const VirtualProjector projector(truth);
  for (const double far : {-1e300, -0.01, 1.01, 1e300, HUGE_VAL, -HUGE_VAL}) {
    const Eigen::Vector3d drive = projector.drive_towards({far, 0.3, 0.3});
    EXPECT_EQ(drive[0], far > 0 ? 1 : 0) << far;
    const Eigen::Vector3d output = projector.interact(drive);
    EXPECT_NEAR(output[1], 0.3, 1e-9) << far << ": the other channels are still right";
    EXPECT_NEAR(output[2], 0.3, 1e-9) << far;
  }
  EXPECT_TRUE(std::isnan(projector.drive_towards({0.5, 0.5, std::nan("")})[2]));
}

TEST(VirtualProjector, PixelsFollowThePinhole) {
  const VirtualProjector projector(plain_truth().projector);
  // It looks down -z with +y up: what lies right of the origin for it is +x, what lies low is -y.
  const auto right_low = projector.pixel_of({0.05, -0.025, 0});
  ASSERT_TRUE(right_low);
  EXPECT_NEAR(right_low->x(), 32 + 320 * 0.05, 1e-9);
  EXPECT_NEAR(right_low->y(), 24 + 320 * 0.025, 1e-9);
  EXPECT_FALSE(projector.pixel_of({0.2, 0, 0})) << "off the raster";
  EXPECT_FALSE(projector.pixel_of({0, 0, 2})) << "behind the lens";
  EXPECT_FALSE(projector.pixel_of({0, 0, 1})) << "at the lens";
}

TEST(VirtualProjector, VignettingIsOneAtTheCentreAndFallsOutwards) {
  ProjectorTruth truth = plain_truth().projector;
  truth.vignetting_exponent = 4;
  truth.vignetting_drop = 0.2;
  const VirtualProjector projector(truth);
  EXPECT_NEAR(projector.vignetting({32, 24}), 1, 1e-12);
  const double corner_cosine = 1 / std::sqrt(1 + (32.0 * 32 + 24.0 * 24) / (320.0 * 320));
  EXPECT_NEAR(projector.vignetting({0, 0}), std::pow(corner_cosine, 4) * 0.8, 1e-12);
}

TEST(VirtualProjector, RefusesFramesThatDoNotFit) {
  const VirtualProjector projector(plain_truth().projector);
  const Image<Rgb16> low(64, 47);
  const auto size = projector.project(low.view());
  ASSERT_FALSE(size);
  EXPECT_THAT(size.error().what, HasSubstr("64 x 47"));
  Image<Rgb16> frame(64, 48);
  frame(3, 5) = {0, 256, 0};
  const auto code = projector.project(frame.view());
  ASSERT_FALSE(code);
  EXPECT_EQ(code.error().code, Errc::kInvalidOption);
  EXPECT_THAT(code.error().what, HasSubstr("pixel 3, 5"));
}

TEST(Blurred, KeepsTheLight) {
  for (const double sigma : {0.2, 0.35, 1.0, 2.5}) {
    Pcg32 random(6);
    Image<Rgb32f> image(64, 48, Rgb32f::Zero());
    for (int y = 16; y < 32; ++y)  // far enough from the border that nothing is lost over it
      for (int x = 16; x < 48; ++x)
        image(x, y) = Rgb32f(static_cast<float>(random.uniform()), 1, 0);
    constexpr double kFloatSums = 1e-5;
    EXPECT_TRUE(total(blurred(image, sigma)).isApprox(total(image), kFloatSums)) << sigma;
  }
}

TEST(Blurred, SpreadsAPointAsTheIntegralOfAGaussian) {
  Image<Rgb32f> image(9, 9, Rgb32f::Zero());
  image(4, 4) = Rgb32f::Ones();
  const double sigma = 0.35;
  const Image<Rgb32f> spread = blurred(image, sigma);
  const double within = std::erf(0.5 / (sigma * std::sqrt(2.0)));
  const double beside = 0.5 * (std::erf(1.5 / (sigma * std::sqrt(2.0))) - within);
  constexpr double kFloat = 1e-6;
  EXPECT_NEAR(spread(4, 4).x(), within * within, kFloat);
  EXPECT_NEAR(spread(5, 4).x(), within * beside, kFloat);
  EXPECT_NEAR(spread(4, 3).y(), within * beside, kFloat);
  EXPECT_NEAR(spread(3, 5).z(), beside * beside, kFloat);
}

TEST(Blurred, LeavesTheImageAloneWithoutBlur) {
  Image<Rgb32f> image(2, 1, Rgb32f(1, 2, 3));
  EXPECT_EQ(blurred(image, 0)(1, 0), image(1, 0));
}

}  // namespace
}  // namespace veneer::simulation
