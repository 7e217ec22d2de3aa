// SPDX-License-Identifier: Apache-2.0
#include "render/compensation.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/ipt.h"
#include "base/random.h"
#include "render/dither.h"
#include "render/internal_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr int kBits = 8;
const calibration::ProjectorProfile& profile() {
  static const auto kProfile = example_profile(64, 48, kBits);
  return kProfile;
}

const Vector3d kEven = Vector3d::Ones();  // a surface without a map

// The image formation as ProjectorProfile states it, written down again.
Xyz shown(const Vector3d& t, double g, const Vector3d& reflectance = kEven) {
  const auto& p = profile();
  const Eigen::Matrix3d surface =
      p.surface * p.primaries * reflectance.asDiagonal() * p.primaries.inverse();
  return surface * (g * (p.primaries * t + p.black) + p.ambient);
}
Vector3d light_of(const std::array<std::uint16_t, 3>& codes) {
  const auto& curves = profile().tone_curves;
  return {curves[0][codes[0]], curves[1][codes[1]], curves[2][codes[2]]};
}
Vector3d random_drive(Pcg32& random) {
  return {random.uniform(), random.uniform(), random.uniform()};
}
Ipt ipt_of(const Xyz& xyz) {
  const Xyz white = profile().primaries * Vector3d::Ones() + profile().black;
  return ipt_from_cones((cones_from_xyz() * xyz).cwiseQuotient(cones_from_xyz() * white));
}
CompensatedPixel compensate(const Compensation& compensation, const Xyz& target, double g) {
  return compensation.pixel(target, g, 1.0, kEven, 3, 5, 7);
}

// A few thousand roundings of 1, amplified by the condition of M and A.
constexpr double kSolveTolerance = 1e-10;

TEST(Compensation, SendsEveryReachableTargetExactly) {
  const Compensation compensation(profile(), {});
  Pcg32 random(1);
  for (int i = 0; i < 2000; ++i) {
    const double g = 0.05 + 2 * random.uniform();
    const Vector3d t = random_drive(random);
    const CompensatedPixel pixel = compensate(compensation, shown(t, g), g);
    ASSERT_EQ(pixel.state, PixelState::kInGamut);
    ASSERT_LT((pixel.drive - t).norm(), kSolveTolerance) << t.transpose() << ", G " << g;
    ASSERT_EQ(pixel.gamut_loss, 0.0);
  }
}

TEST(Compensation, VignettingAndGeometryMultiply) {
  const Compensation compensation(profile(), {});
  const Xyz target = shown({0.4, 0.5, 0.6}, 0.7);
  const auto whole = compensation.pixel(target, 0.7, 1.0, kEven, 0, 0, 0);
  const auto parts = compensation.pixel(target, 1.4, 0.5, kEven, 0, 0, 0);
  EXPECT_LT((whole.drive - parts.drive).norm(), kSolveTolerance);
}

// Dark and light texels of any colour: from a fiftieth of the reference to three times as much.
Vector3d random_reflectance(Pcg32& random) {
  const auto factor = [&random] { return 0.02 * std::pow(150.0, random.uniform()); };
  return {factor(), factor(), factor()};
}

TEST(Compensation, SendsReachableTargetsFromAPatternedSurface) {
  const Compensation compensation(profile(), {});
  Pcg32 random(8);
  for (int i = 0; i < 2000; ++i) {
    const double g = 0.05 + 2 * random.uniform();
    const Vector3d s = random_reflectance(random);
    const Vector3d t = random_drive(random);
    const Xyz target = shown(t, g, s);
    const CompensatedPixel pixel = compensation.pixel(target, g, 1.0, s, 3, 5, 7);
    ASSERT_EQ(pixel.state, PixelState::kInGamut);
    // M^-1 A^-1 L is a sum of terms as large as the best reflected primary's.
    const double amplified = s.maxCoeff() / s.minCoeff();
    ASSERT_LT((pixel.drive - t).norm(), kSolveTolerance * amplified) << s.transpose();
    ASSERT_LT((shown(pixel.drive, g, s) - target).norm(), kSolveTolerance * target.norm());
  }
}

// The bisection ends this close to the gamut's border, as a part of the way from the axis.
constexpr double kChromaStep = 1.0 / (1 << kGamutSteps);

TEST(Compensation, MappedColoursKeepTheirHueAndCountTheirLoss) {
  const Compensation compensation(profile(), {});
  Pcg32 random(2);
  int mapped = 0;
  for (int i = 0; i < 4000; ++i) {
    const double g = 0.2 + random.uniform();
    // Up to four times too bright, and down to below black.
    const Xyz target = shown(4.0 * random_drive(random) - Vector3d::Constant(1.0), g);
    if (target.minCoeff() < 0) continue;  // no light
    const CompensatedPixel pixel = compensate(compensation, target, g);
    ASSERT_GE(pixel.drive.minCoeff(), 0.0);
    ASSERT_LE(pixel.drive.maxCoeff(), 1.0);
    if (pixel.state != PixelState::kOutOfGamut) continue;
    ++mapped;
    const Ipt wanted = ipt_of(target);
    const Ipt got = ipt_of(shown(pixel.drive, g));
    // Loss: what was counted is the distance that is seen.
    ASSERT_NEAR(pixel.gamut_loss, 100 * (wanted - got).norm(), 1e-6) << target.transpose();
    // Hue: the chroma vectors point the same way (cross product 0, inner product not negative).
    const double cross = wanted.y() * got.z() - wanted.z() * got.y();
    ASSERT_NEAR(cross, 0.0, 1e-9) << target.transpose();
    ASSERT_GE(wanted.tail<2>().dot(got.tail<2>()), 0.0);
    ASSERT_LE(got.tail<2>().norm(), wanted.tail<2>().norm());
    // No more than needed: the result touches the border of what the drive can do.
    const double to_border =
        std::min(pixel.drive.minCoeff(), (Vector3d::Ones() - pixel.drive).minCoeff());
    ASSERT_LT(to_border, 40 * kChromaStep) << pixel.drive.transpose();
  }
  EXPECT_GT(mapped, 1000);
}

TEST(Compensation, MapsToWhatThePatternedSurfaceCanShow) {
  const Compensation compensation(profile(), {});
  Pcg32 random(9);
  int mapped = 0;
  int on_axis_line = 0;
  for (int i = 0; i < 4000; ++i) {
    const double g = 0.2 + random.uniform();
    const Vector3d s = random_reflectance(random);
    const Xyz target = shown(4.0 * random_drive(random) - Vector3d::Constant(1.0), g, s);
    if (target.minCoeff() < 0) continue;  // no light
    const CompensatedPixel pixel = compensation.pixel(target, g, 1.0, s, 3, 5, 7);
    ASSERT_GE(pixel.drive.minCoeff(), 0.0);
    ASSERT_LE(pixel.drive.maxCoeff(), 1.0);
    if (pixel.state != PixelState::kOutOfGamut) continue;
    ++mapped;
    const Ipt wanted = ipt_of(target);
    const Ipt got = ipt_of(shown(pixel.drive, g, s));
    ASSERT_NEAR(pixel.gamut_loss, 100 * (wanted - got).norm(), 1e-6) << s.transpose();
    const double cross = wanted.y() * got.z() - wanted.z() * got.y();
    if (std::abs(cross) < 1e-9) ++on_axis_line;
  }
  EXPECT_GT(mapped, 1000);
  // Where ambient light alone colours the texel beyond any neutral, the hue is lost by design.
  EXPECT_GT(on_axis_line, 0.9 * mapped);
}

// A pixel that reflects half of every primary needs what an even surface needs for twice the light.
TEST(Compensation, AGreyTexelIsAnEvenSurfaceWithABrighterTarget) {
  const Compensation compensation(profile(), {});
  Pcg32 random(10);
  for (int i = 0; i < 500; ++i) {
    const Xyz target = shown(random_drive(random), 0.6);
    const auto grey = compensation.pixel(0.5 * target, 0.6, 1.0, Vector3d::Constant(0.5), 1, 2, 3);
    const auto even = compensation.pixel(target, 0.6, 1.0, kEven, 1, 2, 3);
    ASSERT_EQ(grey.state, even.state);
    ASSERT_LT((grey.drive - even.drive).norm(), kSolveTolerance);
  }
}

TEST(Compensation, StaysFiniteAtTheEndsOfReflectance) {
  const Compensation compensation(profile(), {});
  constexpr double kLeast = calibration::kLeastReflectance;
  for (const double s : {kLeast, 1.0 / kLeast}) {
    for (const double other : {kLeast, 1.0, 1.0 / kLeast}) {
      for (const double light : {0.0, 1e-3, 50.0, 65504.0}) {
        const auto pixel =
            compensation.pixel(Xyz::Constant(light), 0.05, 1.0, {s, other, 1.0}, 1, 2, 3);
        EXPECT_GE(pixel.drive.minCoeff(), 0.0) << s << ' ' << other << ' ' << light;
        EXPECT_LE(pixel.drive.maxCoeff(), 1.0) << s << ' ' << other << ' ' << light;
        EXPECT_TRUE(std::isfinite(pixel.gamut_loss)) << s << ' ' << other << ' ' << light;
      }
    }
  }
}

TEST(Compensation, GamutMappingIsContinuousAtTheBorder) {
  const Compensation compensation(profile(), {});
  Pcg32 random(3);
  for (int i = 0; i < 500; ++i) {
    Vector3d t = random_drive(random);
    const int channel = i % 3;
    t[channel] = i % 2 == 0 ? 1.0 + 2 * kGamutTolerance : -2 * kGamutTolerance;
    const CompensatedPixel pixel = compensate(compensation, shown(t, 0.9), 0.9);
    ASSERT_EQ(pixel.state, PixelState::kOutOfGamut);
    // Just outside, the way into the gamut along the line of equal hue may be a few times as long
    // as the distance to it; the dark border is seen under the steep start of the cube root's kin.
    ASSERT_LT((pixel.drive - t).norm(), 0.05) << t.transpose();
  }
}

TEST(Compensation, TargetsBelowBlackAndAmbientAreOutOfGamut) {
  const Compensation compensation(profile(), {});
  EXPECT_EQ(compensate(compensation, Xyz::Zero(), 0.8).state, PixelState::kOutOfGamut);
  EXPECT_EQ(compensate(compensation, 0.5 * shown(Vector3d::Zero(), 0.8), 0.8).state,
            PixelState::kOutOfGamut);
  const auto black = compensate(compensation, shown(Vector3d::Zero(), 0.8), 0.8);
  EXPECT_EQ(black.state, PixelState::kInGamut);
  EXPECT_LT(black.drive.norm(), kSolveTolerance);
}

TEST(Compensation, ClampsWhereNoNeutralCanBeShown) {
  auto tinted = profile();
  tinted.ambient = {60, 20, 1};  // far more red than the projector's blue can balance at this G
  const Compensation compensation(tinted, {});
  const auto pixel = compensation.pixel({0.5, 0.5, 3.0}, 0.06, 1.0, kEven, 0, 0, 0);
  EXPECT_EQ(pixel.state, PixelState::kOutOfGamut);
  EXPECT_GE(pixel.drive.minCoeff(), 0.0);
  EXPECT_LE(pixel.drive.maxCoeff(), 1.0);
  EXPECT_GT(pixel.gamut_loss, 0.0);
  EXPECT_TRUE(std::isfinite(pixel.gamut_loss));
}

TEST(Compensation, RefusesWhatIsNotFiniteOrOutOfReach) {
  const Compensation compensation(profile(), {.geometry_floor = 0.1});
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const Xyz fine = shown({0.5, 0.5, 0.5}, 0.5);
  for (const double bad : {kNan, kInf, -kInf}) {
    const auto pixel = compensate(compensation, {fine.x(), bad, fine.z()}, 0.5);
    EXPECT_EQ(pixel.state, PixelState::kOutOfReach) << bad;
    EXPECT_EQ(pixel.codes, (std::array<std::uint16_t, 3>{}));
  }
  EXPECT_EQ(compensate(compensation, fine, kNan).state, PixelState::kOutOfReach);
  EXPECT_EQ(compensate(compensation, fine, kInf).state, PixelState::kOutOfReach);
  EXPECT_EQ(compensate(compensation, fine, 0.0999).state, PixelState::kOutOfReach);
  EXPECT_NE(compensate(compensation, fine, 0.1001).state, PixelState::kOutOfReach);
  EXPECT_EQ(compensate(compensation, fine, 0.0).state, PixelState::kNotCovered);
  EXPECT_EQ(compensate(compensation, fine, -1.0).state, PixelState::kNotCovered);
}

TEST(Compensation, DitherShowsTheTargetInTheMean) {
  const Compensation compensation(profile(), {});
  Pcg32 random(4);
  constexpr int kSide = 64;
  // A lattice of n points estimates a part with an error of a few 1/n; n = 4096 here.
  constexpr double kLatticeTolerance = 8.0 / (kSide * kSide);
  for (int i = 0; i < 20; ++i) {
    const Vector3d t = random_drive(random);
    const Xyz target = shown(t, 0.9);
    Vector3d sum = Vector3d::Zero();
    Vector3d step = Vector3d::Zero();
    for (std::uint32_t y = 0; y < kSide; ++y) {
      for (std::uint32_t x = 0; x < kSide; ++x) {
        const auto pixel =
            compensation.pixel(target, 0.9, 1.0, kEven, x, y, static_cast<std::uint32_t>(i));
        sum += light_of(pixel.codes);
      }
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const auto bracket = compensation.tone_levels()[c].bracket(t[static_cast<int>(c)]);
      step[static_cast<int>(c)] =
          profile().tone_curves[c][bracket.upper] - profile().tone_curves[c][bracket.lower];
    }
    const Vector3d mean = sum / (kSide * kSide);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(mean[c], t[c], kLatticeTolerance * step[c] + 1e-7) << t.transpose();
  }
}

TEST(DitherThreshold, IsUniformOverPixelsAndOverSeeds) {
  // Chi-square over 32 equal bins; a lattice is far more even than chance, so that half the
  // expected value (31) of a random one is generous.
  constexpr int kBins = 32;
  constexpr std::uint32_t kCount = 8192;
  for (std::uint32_t channel = 0; channel < 3; ++channel) {
    std::array<int, kBins> over_pixels{};
    std::array<int, kBins> over_seeds{};
    for (std::uint32_t i = 0; i < kCount; ++i) {
      const float a = dither_threshold(100 + i % 128, 37 + i / 128, channel, 5);
      const float b = dither_threshold(17, 4, channel, i);
      ASSERT_GT(a, 0.0F);
      ASSERT_LT(a, 1.0F);
      ++over_pixels[static_cast<std::size_t>(a * kBins)];
      ++over_seeds[static_cast<std::size_t>(b * kBins)];
    }
    for (const auto& bins : {over_pixels, over_seeds}) {
      double chi_square = 0;
      constexpr double kExpected = static_cast<double>(kCount) / kBins;
      for (const int n : bins) chi_square += std::pow(n - kExpected, 2) / kExpected;
      EXPECT_LT(chi_square, 15.0);
    }
  }
}

TEST(Compensation, WithoutDitherTakesTheNearerCodeInLinearLight) {
  const Compensation compensation(profile(), {.dither = false});
  Pcg32 random(5);
  for (int i = 0; i < 500; ++i) {
    const Vector3d t = random_drive(random);
    const auto pixel = compensate(compensation, shown(t, 0.9), 0.9);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& curve = profile().tone_curves[c];
      const double off = std::abs(curve[pixel.codes[c]] - t[static_cast<int>(c)]);
      for (const double level : curve)
        ASSERT_LE(off, std::abs(level - t[static_cast<int>(c)]) + 1e-7);
    }
  }
}

TEST(Compensation, SwitchedOffShowsPlainSrgb) {
  const Compensation off(profile(), {.compensate = false, .dither = false});
  const double white = (profile().primaries * Vector3d::Ones()).y();
  Pcg32 random(6);
  for (int i = 0; i < 500; ++i) {
    const Vector3d rgb = 1.2 * random_drive(random);
    const auto pixel =
        off.pixel(white * (xyz_from_srgb() * rgb), 0.3, 0.5, {0.2, 0.5, 2.0}, 1, 2, 3);
    const bool in_gamut = rgb.maxCoeff() <= 1 + kGamutTolerance;
    EXPECT_EQ(pixel.state, in_gamut ? PixelState::kInGamut : PixelState::kOutOfGamut);
    for (int c = 0; c < 3; ++c) {
      const double encoded = 255 * srgb_encode(std::min(rgb[c], 1.0));
      // Rounded in linear light, so up to a little more than half a code from the encoded value.
      EXPECT_NEAR(pixel.codes[static_cast<std::size_t>(c)], encoded, 0.55) << rgb.transpose();
    }
  }
}

TEST(VignettingRaster, StretchesTheMapBilinearly) {
  const auto& p = profile();
  const Image<float> raster = vignetting_raster(p);
  ASSERT_EQ(raster.width(), 64);
  ASSERT_EQ(raster.height(), 48);
  EXPECT_FLOAT_EQ(raster(0, 0), p.vignetting(0, 0));
  EXPECT_FLOAT_EQ(raster(63, 47), p.vignetting(2, 1));
  const float middle = (raster(31, 23) + raster(32, 23) + raster(31, 24) + raster(32, 24)) / 4;
  EXPECT_NEAR(middle, (p.vignetting(1, 0) + p.vignetting(1, 1)) / 2, 1e-2);
  auto without = p;
  without.vignetting = {};
  EXPECT_EQ(vignetting_raster(without)(5, 5), 1.0F);
}

TEST(ReflectanceRaster, IsTheMapAtEveryPixelOrOneWhitePixel) {
  auto p = profile();
  const Image<Rgb32f> none = reflectance_raster(p);
  ASSERT_EQ(none.pixels().size(), 1U);
  EXPECT_EQ(none(0, 0), Rgb32f::Ones());
  p.surface_map = example_surface_map();
  const Image<Rgb32f> raster = reflectance_raster(p);
  ASSERT_EQ(raster.width(), 64);
  ASSERT_EQ(raster.height(), 48);
  EXPECT_EQ(raster(0, 0), p.surface_map(0, 0));
  EXPECT_EQ(raster(40, 20), Rgb32f(p.reflectance_at({40.5, 20.5}).cast<float>()));
}

}  // namespace
}  // namespace veneer::render
