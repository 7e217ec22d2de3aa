// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/additivity.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calibration/colour/internal_testing.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

using Eigen::Vector3d;

constexpr double kNoise = 0.003;
constexpr int kSeeds = 2000;

// A white segment of `part` of the sum of channels: the sum is off by -part / (1 + part).
Additivity tested(const LadderDefects& defects,
                  std::uint64_t seed,
                  double noise = kNoise,
                  int repeats = 4) {
  ColourPatchOptions options;
  options.additivity_repeats = repeats;
  const LadderProjector projector(defects);
  const auto readings = projector.read(additivity_patches(options), 8, noise, seed);
  const auto black = mean_black(projector.read(ramp_patches(options), 8, noise, seed + 100000));
  auto result = test_additivity(readings, black);
  EXPECT_TRUE(result.has_value()) << result.error().what;
  return result ? *result : Additivity{};
}

TEST(Additivity, FailureOfThreePercentIsFoundEveryTime) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    // The sum 3 % short of the mixture by a segment, and 3 % over it by crosstalk.
    EXPECT_FALSE(tested({0, 0.03 / 0.97, 0}, seed).additive) << seed;
    EXPECT_FALSE(tested({0, 0, 0.03 / 1.03}, seed).additive) << seed;
  }
}

TEST(Additivity, FailureOfOnePercentIsNeverReported) {
  for (int seed = 0; seed < kSeeds; ++seed) {
    EXPECT_TRUE(tested({}, seed).additive) << seed;
    EXPECT_TRUE(tested({0, 0.01 / 1.01, 0}, seed).additive) << seed;
    EXPECT_TRUE(tested({0, 0, 0.01 / 1.01}, seed).additive) << seed;
  }
}

TEST(Additivity, MeasuresTheErrorWithoutNoise) {
  const Additivity segment = tested({0, 0.25, 0}, 1, 0.0);
  EXPECT_NEAR(segment.worst_error, -0.2, 1e-9);
  EXPECT_EQ(segment.uncertainty, 0.0);
  EXPECT_TRUE(segment.decisive);
  EXPECT_EQ(segment.mixtures.size(), 8U);
  EXPECT_NEAR(tested({0, 0, 0.05}, 1, 0.0).worst_error, 0.05 / 0.95, 1e-9);
  EXPECT_NEAR(tested({0.06, 0, 0}, 1, 0.0).worst_error, 0.0, 1e-12);
}

TEST(Additivity, UncertaintyIsTheScatterOfItsErrors) {
  double squares = 0.0;
  double stated = 0.0;
  int count = 0;
  for (int seed = 0; seed < 500; ++seed) {
    for (const MixtureError& mixture : tested({}, seed).mixtures) {
      if (mixture.drive != Vector3d::Ones()) continue;
      squares += mixture.error * mixture.error;
      stated += mixture.uncertainty * mixture.uncertainty;
      ++count;
    }
  }
  ASSERT_EQ(count, 500);
  // The error is the largest of three components, whose square is 1.9 times one's on average if
  // they are independent; the uncertainty is that of the component that has most.
  EXPECT_GT(squares / stated, 1.0);
  EXPECT_LT(squares / stated, 2.5);
}

TEST(Additivity, SaysWhenReadingsAreTooNoisy) {
  int undecided = 0;
  for (int seed = 0; seed < 100; ++seed) {
    if (!tested({}, seed, 0.03, 2).decisive) ++undecided;
    EXPECT_TRUE(tested({}, seed).decisive) << seed;
    // So far off that any noise will do.
    EXPECT_TRUE(tested({0, 0.5, 0}, seed, 0.02).decisive) << seed;
  }
  EXPECT_GT(undecided, 90);
}

TEST(Additivity, RefusesWhatSaysNothing) {
  const LadderProjector projector({});
  const Xyz black = projector.black();
  EXPECT_FALSE(test_additivity({}, black).has_value());
  std::vector<PatchReading> readings = projector.read(additivity_patches({}), 8, 0.0, 1);
  std::vector<PatchReading> broken = readings;
  broken[3].xyz.x() = std::nan("");
  EXPECT_FALSE(test_additivity(broken, black).has_value());
  EXPECT_FALSE(test_additivity(readings, Xyz::Constant(HUGE_VAL)).has_value());
  for (PatchReading& reading : broken) reading.xyz = black;
  EXPECT_FALSE(test_additivity(broken, black).has_value());
  // Mixtures whose channels were not read.
  std::erase_if(readings,
                [](const PatchReading& r) { return (r.drive.array() > 0.0).count() == 1; });
  EXPECT_FALSE(test_additivity(readings, black).has_value());
}

}  // namespace
}  // namespace veneer::calibration
