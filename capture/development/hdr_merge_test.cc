// SPDX-License-Identifier: Apache-2.0
#include "capture/development/hdr_merge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "base/random.h"

namespace veneer::capture {
namespace {

constexpr double kFull = 4095;
constexpr double kElectronsPerCount = 5;
constexpr double kReadCounts = 1.5;
constexpr double kOffset = 32;

/// A Poisson deviate: by counting where small, else normal.
double poisson(double mean, Pcg32& random) {
  if (mean > 50) return std::max(0.0, std::round(mean + std::sqrt(mean) * random.normal()));
  double product = 1;
  int count = -1;
  const double limit = std::exp(-mean);
  do {
    product *= 1 - random.uniform();
    ++count;
  } while (product > limit);
  return count;
}
/// Mean of frames of a linear camera with shot noise, read noise, offset, whole counts.
/// @param light  of each pixel, a second, in parts of what saturates above the offset.
Picture photograph(int width,
                   int height,
                   const std::function<double(int)>& light,
                   double seconds,
                   int frames,
                   bool dark,
                   Pcg32& random) {
  Picture picture;
  picture.counts = Image<Rgb32f>(width, height);
  picture.full_scale = kFull;
  picture.exposure_s = seconds;
  picture.frames = frames;
  picture.shot.dark = dark;
  for (int i = 0; i < width * height; ++i) {
    for (int channel = 0; channel < 3; ++channel) {
      const double electrons = dark ? 0 : light(i) * seconds * kFull * kElectronsPerCount;
      double sum = 0;
      bool full = false;
      for (int frame = 0; frame < frames; ++frame) {
        const double counts = std::round(kOffset + poisson(electrons, random) / kElectronsPerCount +
                                         kReadCounts * random.normal());
        full = full || counts >= kFull;
        sum += std::clamp(counts, 0.0, kFull);
      }
      picture.counts.pixels()[static_cast<std::size_t>(i)][channel] =
          static_cast<float>(full ? kFull : sum / frames);
    }
  }
  return picture;
}
NoiseModel true_noise() {
  return {.electrons_per_count = kElectronsPerCount, .read_noise_counts = kReadCounts};
}

TEST(Merge, HasNoBiasAndTheVarianceThatItSays) {
  constexpr int kSide = 80;  // 19200 merges of each light, three channels
  constexpr double kExposures[] = {0.001, 0.004, 0.016, 0.064};
  Pcg32 random(3);
  // Of what saturates in a second: from a hundredth of a count in the longest exposure to near
  // saturation in the shortest; and some where an exposure is just about full.
  for (const double light : {0.0, 4e-5, 1e-3, 0.1, 3.0, 15.4, 15.55, 61.7, 200.0, 900.0}) {
    std::vector<Picture> lit;
    std::vector<Picture> dark;
    for (const double seconds : kExposures) {
      lit.push_back(photograph(
          kSide, kSide, [&](int) { return light; }, seconds, 2, false, random));
      dark.push_back(photograph(
          kSide, kSide, [](int) { return 0.0; }, seconds, 4, true, random));
    }
    const auto merged = merge(lit, dark, ResponseCurve(), true_noise());
    ASSERT_TRUE(merged) << merged.error().what;
    EXPECT_EQ(merged->saturated_fraction, 0) << light;
    double sum = 0;
    double squares = 0;
    double said = 0;
    constexpr double kCount = 3.0 * kSide * kSide;
    for (int i = 0; i < kSide * kSide; ++i) {
      for (int channel = 0; channel < 3; ++channel) {
        const double off = merged->light.pixels()[static_cast<std::size_t>(i)][channel] - light;
        sum += off;
        squares += off * off;
        said += merged->variance.pixels()[static_cast<std::size_t>(i)][channel];
      }
    }
    const double mean = sum / kCount;
    const double variance = squares / kCount - mean * mean;
    // Four standard errors: ten lights leave the bound once in a thousand seeds.
    EXPECT_LT(std::abs(mean), 4 * std::sqrt(variance / kCount)) << light;
    EXPECT_NEAR(said / kCount / variance, 1, 0.1) << light;
  }
}

TEST(Merge, SpansAMillionToOneInOneScene) {
  constexpr int kSide = 40;
  Pcg32 random(5);
  const auto light = [](int i) { return 900.0 * std::pow(10.0, -6.0 * (i / kSide) / (kSide - 1)); };
  std::vector<Picture> lit;
  std::vector<Picture> dark;
  for (double seconds = 0.001; seconds < 20; seconds *= 8) {
    lit.push_back(photograph(kSide, kSide, light, seconds, 1, false, random));
    dark.push_back(photograph(kSide, kSide, light, seconds, 1, true, random));
  }
  const auto merged = merge(lit, dark, ResponseCurve(), true_noise());
  ASSERT_TRUE(merged) << merged.error().what;
  for (int row = 0; row < kSide; ++row) {
    double mean = 0;
    for (int x = 0; x < kSide; ++x) mean += merged->light(x, row)[1] / kSide;
    EXPECT_NEAR(mean / light(row * kSide), 1, 0.05) << light(row * kSide);
  }
}

TEST(Merge, NeverGuessesWhatIsSaturatedInAll) {
  Pcg32 random(6);
  const auto light = [](int i) { return i % 2 == 0 ? 1e6 : 10.0; };
  std::vector<Picture> lit;
  std::vector<Picture> dark;
  for (const double seconds : {0.001, 0.01}) {
    lit.push_back(photograph(20, 20, light, seconds, 1, false, random));
    dark.push_back(photograph(20, 20, light, seconds, 1, true, random));
  }
  for (Picture& picture : lit) picture.counts(1, 0)[2] = static_cast<float>(kFull);
  dark[0].counts(3, 0)[1] = static_cast<float>(kFull);  // a hot pixel, in one exposure
  const auto merged = merge(lit, dark, ResponseCurve(), true_noise());
  ASSERT_TRUE(merged) << merged.error().what;
  EXPECT_EQ(merged->saturated(0, 0), 7);
  EXPECT_EQ(merged->light(0, 0), Rgb32f::Zero());
  EXPECT_EQ(merged->variance(0, 0)[0], std::numeric_limits<float>::infinity());
  EXPECT_EQ(merged->saturated(1, 0), 4);
  EXPECT_NEAR(merged->light(1, 0)[0], 10, 2);
  EXPECT_EQ(merged->saturated(3, 0), 0);
  EXPECT_NEAR(merged->light(3, 0)[1], 10, 2);
  EXPECT_NEAR(merged->saturated_fraction, 0.5 + 1.0 / 400, 1e-9);
}

TEST(Merge, TakesMoreFramesForLessNoise) {
  Pcg32 random(8);
  double before = std::numeric_limits<double>::infinity();
  for (const int frames : {1, 4, 16}) {
    const auto merged = merge(std::vector{photograph(
                                  10, 10, [](int) { return 10.0; }, 0.01, frames, false, random)},
                              std::vector{photograph(
                                  10, 10, [](int) { return 0.0; }, 0.01, frames, true, random)},
                              ResponseCurve(),
                              true_noise());
    ASSERT_TRUE(merged) << merged.error().what;
    const double variance = merged->variance(4, 4)[0];
    if (frames > 1) {
      EXPECT_NEAR(before / variance, 4, 0.3);
    }
    before = variance;
  }
}

TEST(Merge, UndoesACurveAndCarriesItsNoise) {
  // Counts by light^(1 / 2.2), noise of the counts alone: its variance in light is by the slope.
  constexpr double kSigma = 5;
  Pcg32 random(9);
  const ResponseCurve curve = ResponseCurve::gamma(2.2).value();
  for (const double light : {0.02, 0.2, 0.7}) {
    Picture lit;
    lit.counts = Image<Rgb32f>(60, 60);
    lit.full_scale = kFull;
    lit.exposure_s = 1;
    Picture dark = lit;
    for (Rgb32f& pixel : lit.counts.pixels())
      for (int channel = 0; channel < 3; ++channel)
        pixel[channel] =
            static_cast<float>(kFull * std::pow(light, 1 / 2.2) + kSigma * random.normal());
    const NoiseModel noise{.electrons_per_count = 1e9, .read_noise_counts = kSigma};
    const auto merged = merge(std::vector{lit}, std::vector{dark}, curve, noise);
    ASSERT_TRUE(merged) << merged.error().what;
    double sum = 0;
    double squares = 0;
    double said = 0;
    for (std::size_t i = 0; i < merged->light.pixels().size(); ++i) {
      for (int channel = 0; channel < 3; ++channel) {
        const double off = merged->light.pixels()[i][channel] - light;
        sum += off;
        squares += off * off;
        said += merged->variance.pixels()[i][channel];
      }
    }
    EXPECT_NEAR(sum / (3 * 3600), 0, 1e-4) << light;
    EXPECT_NEAR(said / squares, 1, 0.1) << light;
  }
}

TEST(Merge, RefusesWhatIsNoBracket) {
  Pcg32 random(10);
  const Picture lit = photograph(
      8, 8, [](int) { return 1.0; }, 0.1, 1, false, random);
  const Picture dark = photograph(
      8, 8, [](int) { return 1.0; }, 0.1, 1, true, random);
  const auto code = [&](const std::vector<Picture>& a, const std::vector<Picture>& b) {
    const auto merged = merge(a, b, ResponseCurve(), true_noise());
    return merged ? Errc::kCancelled : merged.error().code;
  };
  ASSERT_EQ(code({lit}, {dark}), Errc::kCancelled);  // that is, it is merged
  EXPECT_EQ(code({}, {}), Errc::kInvalidOption);
  EXPECT_EQ(code({lit}, {}), Errc::kInvalidOption);
  const auto changed = [&](const std::function<void(Picture&)>& change) {
    Picture other = lit;
    change(other);
    return code({lit, other}, {dark});
  };
  EXPECT_EQ(changed([](Picture& p) { p.exposure_s = 0.2; }), Errc::kInvalidOption);
  EXPECT_EQ(changed([](Picture& p) { p.exposure_s = 0; }), Errc::kInvalidOption);
  EXPECT_EQ(changed([](Picture& p) { p.exposure_s = std::nan(""); }), Errc::kInvalidOption);
  EXPECT_EQ(changed([](Picture& p) { p.counts = Image<Rgb32f>(7, 8); }), Errc::kInvalidOption);
  EXPECT_EQ(changed([](Picture& p) { p.full_scale = 255; }), Errc::kInvalidOption);
  EXPECT_EQ(changed([](Picture& p) { p.frames = 0; }), Errc::kInvalidOption);
  EXPECT_EQ(changed([](Picture& p) { p.counts(2, 2)[1] = std::nanf(""); }), Errc::kInvalidOption);
  EXPECT_EQ(changed([](Picture& p) { p.counts(2, 2)[1] = -1; }), Errc::kInvalidOption);
  for (const NoiseModel& noise : {NoiseModel{.electrons_per_count = 0},
                                  NoiseModel{.electrons_per_count = std::nan("")},
                                  NoiseModel{.read_noise_counts = -1}}) {
    EXPECT_EQ(merge(std::vector{lit}, std::vector{dark}, ResponseCurve(), noise).error().code,
              Errc::kInvalidOption);
  }
}

TEST(Noise, IsMeasuredFromRepeatsWhateverTheFramesAndThePattern) {
  for (const int frames : {1, 4}) {
    Pcg32 random(11);
    const auto light = [](int i) {  // a ramp with a fixed pattern of 2 %
      return 9.0 * (i % 100) / 100 * (1 + 0.02 * std::sin(12.9898 * i));
    };
    std::vector<Picture> pictures;
    for (int repeat = 0; repeat < 2; ++repeat) {
      pictures.push_back(photograph(100, 80, light, 0.1, frames, false, random));
      pictures.push_back(photograph(100, 80, light, 0.1, frames, true, random));
    }
    for (int i = 0; i < 100; ++i)  // something moved
      pictures[0].counts.pixels()[static_cast<std::size_t>(79 * i)] = Rgb32f::Constant(3000);
    const auto noise = measure_noise(pictures);
    ASSERT_TRUE(noise) << noise.error().what;
    EXPECT_NEAR(noise->electrons_per_count / kElectronsPerCount, 1, 0.05) << frames;
    EXPECT_NEAR(noise->read_noise_counts / kReadCounts, 1, 0.05) << frames;
  }
}

TEST(Noise, RefusesWhatDoesNotRepeatOrHasNoRange) {
  Pcg32 random(12);
  const auto flat = [](int) { return 0.0; };
  const Picture one = photograph(60, 60, flat, 0.1, 1, false, random);
  EXPECT_EQ(measure_noise({}).error().code, Errc::kInvalidOption);
  EXPECT_EQ(measure_noise(std::vector{one}).error().code, Errc::kInvalidOption);
  Picture longer = one;
  longer.exposure_s = 0.2;
  EXPECT_EQ(measure_noise(std::vector{one, longer}).error().code, Errc::kInvalidOption);
  const Picture again = photograph(60, 60, flat, 0.1, 1, false, random);
  EXPECT_EQ(measure_noise(std::vector{one, again}).error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::capture
