// SPDX-License-Identifier: Apache-2.0
#include "simulation/bench/projector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/random.h"
#include "simulation/bench/testing.h"

namespace veneer::simulation {
namespace {

using ::testing::HasSubstr;
using testing::plain_truth;

using Light = VirtualProjector::Light;
using Outputs = VirtualProjector::Outputs;

Outputs total(const Image<Light>& image) {
  Outputs sum = Outputs::Zero();
  for (const Light& pixel : image.pixels()) sum += pixel.cast<double>();
  return sum;
}

Spectrum light_of(const VirtualProjector& projector, const Outputs& outputs) {
  Spectrum sum = Spectrum::Zero();
  for (int i = 0; i < VirtualProjector::kOutputs; ++i)
    sum += outputs[i] * projector.primaries()[static_cast<std::size_t>(i)];
  return sum;
}

/// What a perfect diffuser sends for output 1 of each light.
VirtualProjector::SurfaceOutputs on_white(const VirtualProjector& projector) {
  VirtualProjector::SurfaceOutputs surface;
  for (int i = 0; i < VirtualProjector::kOutputs; ++i)
    surface.col(i) = xyz_of(projector.primaries()[static_cast<std::size_t>(i)]);
  return surface;
}

Xyz xyz_of_drive(const VirtualProjector& projector, const Eigen::Vector3d& drive) {
  return xyz_of(light_of(projector, projector.interact(drive)));
}

/// A projector with every defect at once, each as strong as it may be or nearly so.
ProjectorTruth worst_truth() {
  ProjectorTruth truth = plain_truth().projector;
  truth.leak = 0.05;
  truth.interaction = 0.3;
  truth.chromaticity_drift = 0.3;
  truth.white_segment = 0.6;
  truth.white_segment_exponent = 1.7;
  return truth;
}

Eigen::Vector3d random_drive(Pcg32& random) {
  Eigen::Vector3d drive;
  for (double& d : drive) {
    d = 1.4 * random.uniform() - 0.2;  // so that faces, edges and corners of the cube come up too
    d = std::clamp(d, 0.0, 1.0);
  }
  return drive;
}

TEST(VirtualProjector, TonesRiseFromZeroToOne) {
  ProjectorTruth truth = plain_truth().projector;
  truth.channels[0].exponent = 2.4;
  truth.channels[1] = {ChannelTruth::Tone::kSCurve, 0, 2.6, 2.4, 0.3, 535, 20, 1};
  const VirtualProjector projector(truth);
  Eigen::Vector3d previous = projector.output({0, 0, 0}).head<3>();
  EXPECT_TRUE(previous.isZero());
  for (std::uint16_t code = 1; code < 256; ++code) {
    const Eigen::Vector3d now = projector.output({code, code, code}).head<3>();
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
  EXPECT_NEAR(xyz_of(light_of(projector, projector.output({255, 255, 255}))).y(), 800, 1e-9);
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

TEST(VirtualProjector, WithoutDefectsTheLightIsTheSumOfThreePrimaries) {
  ProjectorTruth truth = plain_truth().projector;
  truth.interaction = 0.1;
  const VirtualProjector projector(truth);
  Pcg32 random(4);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector3d d = random_drive(random);
    Spectrum expected = Spectrum::Zero();
    for (int c = 0; c < 3; ++c) {
      const double others = 0.5 * (d[(c + 1) % 3] + d[(c + 2) % 3]);
      expected += d[c] * (1 - 0.1 * others) * projector.primaries()[static_cast<std::size_t>(c)];
    }
    const Spectrum light = light_of(projector, projector.interact(d));
    EXPECT_LE((light - expected).abs().maxCoeff(), 1e-14 * expected.maxCoeff()) << d.transpose();
  }
}

TEST(VirtualProjector, DriftMovesColourButNoLuminanceAndIsGoneAtFullDrive) {
  ProjectorTruth truth = plain_truth().projector;
  const VirtualProjector pure(truth);
  truth.chromaticity_drift = 0.06;
  const VirtualProjector drifting(truth);
  for (int c = 0; c < 3; ++c) {
    const Eigen::Vector3d channel = Eigen::Vector3d::Unit(c);
    const Xyz full = xyz_of_drive(pure, channel);
    const Xyz others = xyz_of_drive(pure, Eigen::Vector3d::Ones() - channel);
    for (const double d : {0.0, 0.01, 0.3, 0.9, 1.0}) {
      const Xyz got = xyz_of_drive(drifting, d * channel);
      EXPECT_NEAR(got.y(), d * full.y(), 1e-9) << c << ' ' << d;
      const double part = 0.06 * (1 - d);
      const Xyz expected = d * ((1 - part) * full + part * others * (full.y() / others.y()));
      EXPECT_TRUE(got.isApprox(expected, 1e-12)) << c << ' ' << d;
    }
    EXPECT_EQ(xyz_of_drive(drifting, channel), full) << c;
  }
}

TEST(VirtualProjector, TheSegmentIsDarkWhereAChannelIsAndGivesItsPartOfWhite) {
  ProjectorTruth truth = plain_truth().projector;
  truth.white_segment = 0.25;
  truth.white_segment_exponent = 1.3;
  const VirtualProjector projector(truth);
  const auto luminance = [&](const Eigen::Vector3d& d) { return xyz_of_drive(projector, d).y(); };
  EXPECT_NEAR(luminance({1, 1, 1}), 800, 1e-9);
  const double channels = luminance({1, 0, 0}) + luminance({0, 1, 0}) + luminance({0, 0, 1});
  EXPECT_NEAR(channels, 0.75 * 800, 1e-9);
  for (const double d : {0.1, 0.5, 1.0}) {
    EXPECT_NEAR(luminance({d, d, 0}), luminance({d, 0, 0}) + luminance({0, d, 0}), 1e-9) << d;
    EXPECT_NEAR(luminance({1, d, 1}),
                luminance({1, 0, 1}) + luminance({0, d, 0}) + 200 * std::pow(d, 1.3),
                1e-9)
        << d;
  }
  EXPECT_EQ(projector.interact({1, 0, 1})[6], 0);
}

TEST(VirtualProjector, DriveTowardsFindsWhatEveryDriveSends) {
  ProjectorTruth plain = plain_truth().projector;
  ProjectorTruth crosstalk = plain;
  crosstalk.interaction = 0.3;
  ProjectorTruth drift = plain;
  drift.chromaticity_drift = 0.3;
  ProjectorTruth segment = plain;
  segment.white_segment = 0.6;
  segment.white_segment_exponent = 4;
  int kind = 0;
  for (const ProjectorTruth& truth : {plain, crosstalk, drift, segment, worst_truth()}) {
    const VirtualProjector projector(truth);
    const VirtualProjector::SurfaceOutputs surface = on_white(projector);
    Pcg32 random(5);
    for (int trial = 0; trial < 5000; ++trial) {
      const Eigen::Vector3d wanted = random_drive(random);
      const Xyz xyz = surface * projector.interact(wanted);
      const Eigen::Vector3d drive = projector.drive_towards(surface, xyz);
      ASSERT_GE(drive.minCoeff(), 0);
      ASSERT_LE(drive.maxCoeff(), 1);
      // Far below the rounding of pictures in 32-bit floats.
      ASSERT_LE((surface * projector.interact(drive) - xyz).norm(), 1e-8 * xyz.norm())
          << "kind " << kind << ": " << wanted.transpose() << " became " << drive.transpose();
    }
    ++kind;
  }
}

TEST(VirtualProjector, DriveTowardsReachesWhatBruteForceReaches) {
  const VirtualProjector projector(worst_truth());
  const VirtualProjector::SurfaceOutputs surface = on_white(projector);
  constexpr int kSteps = 20;
  std::vector<std::pair<Eigen::Vector3d, Xyz>> grid;
  for (int r = 0; r <= kSteps; ++r)
    for (int g = 0; g <= kSteps; ++g)
      for (int b = 0; b <= kSteps; ++b) {
        const Eigen::Vector3d drive = Eigen::Vector3d(r, g, b) / kSteps;
        grid.emplace_back(drive, surface * projector.interact(drive));
      }
  const Xyz white = surface * projector.interact(Eigen::Vector3d::Ones());
  int reached = 0;
  int out_of_reach = 0;
  Pcg32 random(6);
  for (int trial = 0; trial < 300; ++trial) {
    // About the grey axis, inside the gamut and out of it.
    Xyz xyz = random.uniform() * white;
    for (double& value : xyz) value *= 1 + 0.8 * (random.uniform() - 0.5);
    // The nearest of the grid, then the nearest of ever smaller neighbourhoods.
    const auto miss = [&](const Eigen::Vector3d& drive) {
      return (surface * projector.interact(drive) - xyz).norm();
    };
    Eigen::Vector3d best = std::ranges::min_element(grid, {}, [&xyz](const auto& node) {
                             return (node.second - xyz).norm();
                           })->first;
    for (double step = 1.0 / kSteps; step > 1e-7; step *= 0.7)
      for (int try_near = 0; try_near < 60; ++try_near) {
        Eigen::Vector3d near = best;
        for (double& d : near) d = std::clamp(d + 2 * step * (2 * random.uniform() - 1), 0.0, 1.0);
        if (miss(near) < miss(best)) best = near;
      }
    // The search ends about a millionth of white from what it can reach; what lies out of reach by
    // as little may pass for either.
    const bool found = miss(projector.drive_towards(surface, xyz)) < 1e-9 * white.norm();
    const double brute_miss = miss(best) / white.norm();
    if (brute_miss > 1e-6 && brute_miss < 1e-4) continue;
    EXPECT_EQ(found, brute_miss <= 1e-6)
        << xyz.transpose() << ": brute force misses by " << brute_miss << " of white";
    ++(found ? reached : out_of_reach);
  }
  EXPECT_GT(reached, 50);
  EXPECT_GT(out_of_reach, 50);
}

TEST(VirtualProjector, DriveTowardsStaysWithinTheCubeAndKeepsNan) {
  const VirtualProjector projector(worst_truth());
  const VirtualProjector::SurfaceOutputs surface = on_white(projector);
  for (const double far : {-1e300, -1.0, 0.0, 1e-300, 1e4, 1e300}) {
    const Eigen::Vector3d drive = projector.drive_towards(surface, {far, 100, 100});
    EXPECT_GE(drive.minCoeff(), 0) << far;
    EXPECT_LE(drive.maxCoeff(), 1) << far;
  }
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL})
    EXPECT_TRUE(std::isnan(projector.drive_towards(surface, {1, bad, 1})[0])) << bad;
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

TEST(VirtualProjector, ThreeChannelsSeeTheSumOfTheLights) {
  ProjectorTruth truth = worst_truth();
  truth.blur_px = 0.6;
  const VirtualProjector projector(truth);
  const Eigen::Matrix<float, 3, VirtualProjector::kOutputs> channels =
      on_white(projector).cast<float>();
  Pcg32 random(11);
  Image<Rgb16> frame(64, 48);
  for (Rgb16& code : frame.pixels())
    for (auto& value : code) value = static_cast<std::uint16_t>(256 * random.uniform());
  const auto light = projector.project(frame.view());
  const auto seen = projector.project(frame.view(), channels);
  ASSERT_TRUE(light && seen);
  constexpr float kFloatSums = 1e-5F;
  for (std::size_t i = 0; i < frame.pixels().size(); ++i)
    EXPECT_TRUE(seen->pixels()[i].isApprox(channels * light->pixels()[i], kFloatSums)) << i;
  const Image<Rgb16> low(64, 47);
  EXPECT_FALSE(projector.project(low.view(), channels));
}

TEST(Blurred, KeepsTheLight) {
  for (const double sigma : {0.2, 0.35, 1.0, 2.5}) {
    Pcg32 random(6);
    Image<Light> image(64, 48, Light::Zero());
    for (int y = 16; y < 32; ++y)  // far enough from the border that nothing is lost over it
      for (int x = 16; x < 48; ++x)
        image(x, y) << static_cast<float>(random.uniform()), 1, 0, 0, 2, 0, 0.5F;
    constexpr double kFloatSums = 1e-5;
    EXPECT_TRUE(total(blurred(image, sigma)).isApprox(total(image), kFloatSums)) << sigma;
  }
}

TEST(Blurred, SpreadsAPointAsTheIntegralOfAGaussian) {
  Image<Light> image(9, 9, Light::Zero());
  image(4, 4) = Light::Ones();
  const double sigma = 0.35;
  const Image<Light> spread = blurred(image, sigma);
  const double within = std::erf(0.5 / (sigma * std::sqrt(2.0)));
  const double beside = 0.5 * (std::erf(1.5 / (sigma * std::sqrt(2.0))) - within);
  constexpr double kFloat = 1e-6;
  EXPECT_NEAR(spread(4, 4).x(), within * within, kFloat);
  EXPECT_NEAR(spread(5, 4).x(), within * beside, kFloat);
  EXPECT_NEAR(spread(4, 3).y(), within * beside, kFloat);
  EXPECT_NEAR(spread(3, 5)[6], beside * beside, kFloat);
}

TEST(Blurred, LeavesTheImageAloneWithoutBlur) {
  Image<Light> image(2, 1, Light::LinSpaced(1, 7));
  EXPECT_EQ(blurred(image, 0)(1, 0), image(1, 0));
}

}  // namespace
}  // namespace veneer::simulation
