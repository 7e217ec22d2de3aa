// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/sensor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "simulation/studio/testing.h"

namespace veneer::simulation::studio {
namespace {

using simulation::testing::small_truth;

Image<Rgb32f> even_light(const StudioTruth& truth, float light) {
  return {truth.width, truth.height, Rgb32f::Constant(light)};
}

struct Moments {
  double mean = 0;
  double variance = 0;
};

/// Of all channels of a picture.
Moments moments_of(const Image<Rgb16>& picture) {
  double sum = 0;
  double squares = 0;
  double count = 0;
  for (const Rgb16& pixel : picture.pixels())
    for (const std::uint16_t value : pixel) {
      sum += value;
      squares += static_cast<double>(value) * value;
      ++count;
    }
  return {sum / count, squares / count - sum / count * (sum / count)};
}

TEST(StudioSensor, QuantisationIsExact) {
  // So many electrons that the noise is 1e-6 of full scale.
  for (const int bits : {8, 10, 12, 16}) {
    StudioTruth truth = small_truth();
    truth.bits = bits;
    const StudioSensor sensor(truth);
    const double full_scale = std::ldexp(1, bits) - 1;
    EXPECT_EQ(sensor.full_scale(), full_scale);
    for (const double wanted : {0.0, 1.0, 17.0, 0.4 * full_scale, 0.9 * full_scale}) {
      // Beside the whole count, but further from the next one than the noise reaches.
      const double count = std::floor(wanted) + (wanted == 0 ? 0 : bits == 16 ? 0.1 : 0.4);
      const auto light = static_cast<float>(count / full_scale * StudioSensor::kConverterReach);
      const auto picture = sensor.expose(even_light(truth, light), StudioSensor::kFill_s, 1, 7);
      for (const Rgb16& pixel : picture.pixels())
        for (const std::uint16_t value : pixel) ASSERT_EQ(value, std::floor(wanted)) << bits;
    }
  }
}

TEST(StudioSensor, GainAndExposureAreFactors) {
  StudioTruth truth = small_truth();
  const StudioSensor sensor(truth);
  const double once = moments_of(sensor.expose(even_light(truth, 0.2F), 0.05, 1, 1)).mean;
  EXPECT_NEAR(moments_of(sensor.expose(even_light(truth, 0.2F), 0.1, 1, 2)).mean, 2 * once, 1);
  EXPECT_NEAR(moments_of(sensor.expose(even_light(truth, 0.2F), 0.05, 4, 3)).mean, 4 * once, 2);
  EXPECT_NEAR(moments_of(sensor.expose(even_light(truth, 0.6F), 0.05, 1, 4)).mean, 3 * once, 2);
}

TEST(StudioSensor, AllSaturatedPixelsSaySo) {
  StudioTruth truth = small_truth();
  truth.full_well = 20000;
  truth.read_noise = 20;
  truth.fixed_pattern = 0.02;
  truth.bits = 12;
  for (const double offset : {0.0, 16.0}) {
    truth.offset_counts = offset;
    const StudioSensor sensor(truth);
    for (const float light : {1.2F, 1000.0F, 1e9F}) {
      const auto picture = sensor.expose(even_light(truth, light), StudioSensor::kFill_s, 1, 5);
      for (const Rgb16& pixel : picture.pixels())
        for (const std::uint16_t value : pixel) ASSERT_EQ(value, sensor.full_scale()) << light;
    }
  }
}

// Janesick 2007: with R read noise and k electrons a count, the variance is R^2 + mean / k and what
// rounding adds, 1/12.
TEST(StudioSensor, VarianceFollowsThePhotonTransferLine) {
  StudioTruth truth = small_truth();
  truth.full_well = 20000;
  truth.read_noise = 6;
  truth.bits = 12;
  truth.offset_counts = 0;
  const StudioSensor sensor(truth);
  const double electrons_per_count = StudioSensor::kConverterReach * 20000 / 4095;
  // From where electrons are counted one by one up to 90 % of the range; below, the read noise is
  // cut at 0.
  for (const double electrons : {28.0, 31.0, 300.0, 3000.0, 17000.0}) {
    const auto light = static_cast<float>(electrons / 20000);
    const Moments got =
        moments_of(sensor.expose(even_light(truth, light), StudioSensor::kFill_s, 1, 11));
    const double variance =
        (electrons + 36) / (electrons_per_count * electrons_per_count) + 1.0 / 12;
    const double count = 3.0 * truth.width * truth.height;
    EXPECT_NEAR(got.mean, electrons / electrons_per_count, 5 * std::sqrt(variance / count))
        << electrons;
    // The standard error of a variance is sqrt(2 / n) of it; the table of deviates adds a little.
    EXPECT_NEAR(got.variance / variance, 1, 5 * std::sqrt(2 / count) + 2e-3) << electrons;
  }
}

TEST(StudioSensor, DarkCurrentGathersWithTime) {
  StudioTruth truth = small_truth();
  truth.full_well = 20000;
  truth.dark_current = 50;
  truth.bits = 16;
  const StudioSensor sensor(truth);
  EXPECT_EQ(sensor.electrons(0, 4), 200);
  EXPECT_NEAR(sensor.electrons(0.25, StudioSensor::kFill_s), 5005, 1e-9);
  const double counts = moments_of(sensor.expose(even_light(truth, 0), 4, 1, 1)).mean;
  const double electrons_per_count = StudioSensor::kConverterReach * 20000 / 65535;
  const double error = std::sqrt(200.0 / (3.0 * truth.width * truth.height));
  EXPECT_NEAR(counts * electrons_per_count, 200, 5 * error);
}

/// Mean of many pictures, which leaves the pattern.
Image<Rgb32f> mean_picture(const StudioSensor& sensor,
                           const Image<Rgb32f>& light,
                           std::uint64_t first) {
  constexpr int kPictures = 64;
  Image<Rgb32f> mean(light.width(), light.height());
  for (std::uint64_t number = first; number < first + kPictures; ++number) {
    const auto picture = sensor.expose(light, StudioSensor::kFill_s, 1, number);
    for (std::size_t i = 0; i < mean.pixels().size(); ++i)
      for (int c = 0; c < 3; ++c)
        mean.pixels()[i][c] +=
            static_cast<float>(picture.pixels()[i][static_cast<std::size_t>(c)]) / kPictures;
  }
  return mean;
}

/// Correlation of the first channel of two pictures, and standard deviation of the first's.
std::pair<double, double> correlation(const Image<Rgb32f>& a, const Image<Rgb32f>& b) {
  double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  const auto count = static_cast<double>(a.pixels().size());
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    sum_a += a.pixels()[i][0];
    sum_b += b.pixels()[i][0];
  }
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    const double da = a.pixels()[i][0] - sum_a / count;
    const double db = b.pixels()[i][0] - sum_b / count;
    aa += da * da;
    bb += db * db;
    ab += da * db;
  }
  return {ab / std::sqrt(aa * bb), std::sqrt(aa / count)};
}

TEST(StudioSensor, PatternsRepeatAndAreOfTheirSize) {
  StudioTruth truth = small_truth();
  truth.full_well = 1e6;
  truth.fixed_pattern = 0.01;
  truth.offset_counts = 200;
  const StudioSensor sensor(truth);
  const Image<Rgb32f> half = even_light(truth, 0.5F);
  const Image<Rgb32f> none = even_light(truth, 0);
  const auto [lit, lit_deviation] =
      correlation(mean_picture(sensor, half, 0), mean_picture(sensor, half, 100));
  EXPECT_GT(lit, 0.99);
  const double of_gain = 0.01 * 0.5 / StudioSensor::kConverterReach * 65535;
  EXPECT_NEAR(lit_deviation, std::hypot(of_gain, 20), 0.03 * of_gain);
  const auto [dark, dark_deviation] =
      correlation(mean_picture(sensor, none, 200), mean_picture(sensor, none, 300));
  EXPECT_GT(dark, 0.99);
  EXPECT_NEAR(dark_deviation, 20, 0.6);
  // Those of another sensor are others: only chance, 1 / sqrt(19200), brings them together.
  truth.seed = 2;
  const StudioSensor other(truth);
  EXPECT_LT(
      std::abs(correlation(mean_picture(sensor, half, 0), mean_picture(other, half, 0)).first),
      0.04);
}

TEST(StudioSensor, TheResponseCurveIsThePowerThatItSays) {
  StudioTruth truth = small_truth();
  truth.response_gamma = 2.2;
  truth.offset_counts = 100;
  const StudioSensor curved(truth);
  truth.response_gamma = 1;
  const StudioSensor linear(truth);
  for (const float light : {0.0F, 0.01F, 0.3F, 0.8F, 2.0F}) {
    const auto bent = curved.expose(even_light(truth, light), StudioSensor::kFill_s, 1, 3);
    const auto straight = linear.expose(even_light(truth, light), StudioSensor::kFill_s, 1, 3);
    for (std::size_t i = 0; i < bent.pixels().size(); ++i) {
      // Undone, a step of the curve is as wide as its slope there.
      const double fraction = bent.pixels()[i][0] / 65535.0;
      const double slope = 2.2 * std::pow(fraction, 1.2);
      ASSERT_NEAR(
          65535 * std::pow(fraction, 2.2), straight.pixels()[i][0], 0.5 + 0.51 * slope + 0.05)
          << light;
    }
  }
}

TEST(StudioSensor, ANumberGivesItsPictureAndNoOther) {
  StudioTruth truth = small_truth();
  truth.full_well = 20000;
  const StudioSensor sensor(truth);
  const StudioSensor again(truth);
  const Image<Rgb32f> light = even_light(truth, 0.4F);
  const auto a = sensor.expose(light, 0.05, 1, 1);
  const auto b = again.expose(light, 0.05, 1, 1);
  const auto c = sensor.expose(light, 0.05, 1, 2);
  EXPECT_TRUE(std::ranges::equal(a.pixels(), b.pixels()));
  EXPECT_FALSE(std::ranges::equal(a.pixels(), c.pixels()));
}

TEST(StudioSensor, AMosaicsChannelsAreOne) {
  StudioTruth truth = small_truth();
  truth.full_well = 20000;
  truth.mosaic = true;
  const StudioSensor sensor(truth);
  const auto picture = sensor.expose(even_light(truth, 0.4F), 0.05, 1, 1);
  for (const Rgb16& pixel : picture.pixels()) {
    ASSERT_EQ(pixel[0], pixel[1]);
    ASSERT_EQ(pixel[0], pixel[2]);
  }
}

}  // namespace
}  // namespace veneer::simulation::studio
