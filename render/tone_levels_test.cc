// SPDX-License-Identifier: Apache-2.0
#include "render/tone_levels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"

namespace veneer::render {
namespace {

// Curves of 2^bits values: smooth ones, one that is steep in the dark and in the bright, one with
// plateaus (dead codes at both ends and in the middle), and one of few levels.
std::vector<std::vector<double>> curves(int size) {
  std::vector<std::vector<double>> all(5);
  for (int i = 0; i < size; ++i) {
    const double x = static_cast<double>(i) / (size - 1);
    all[0].push_back(x);
    all[1].push_back(std::pow(x, 2.4));
    all[2].push_back(0.5 + 0.5 * std::copysign(std::pow(std::abs(2 * x - 1), 0.2), 2 * x - 1));
    all[3].push_back(std::clamp(std::floor(x * 40) / 30 - 0.1, 0.0, 1.0));
    all[4].push_back(x < 1.0 ? 0.0 : 1.0);
  }
  return all;
}

// One rounding of a level to float, relative to 1.
constexpr double kFloatTolerance = 0x1p-24;

TEST(ToneLevels, BracketsEveryOutputBetweenAdjacentLevels) {
  Pcg32 random(1);
  for (const int size : {256, 1024}) {
    for (const auto& curve : curves(size)) {
      const ToneLevels tone(curve);
      for (int i = 0; i < 2000; ++i) {
        const double t = i == 0 ? 0.0 : i == 1 ? 1.0 : std::pow(random.uniform(), i % 4 + 1);
        const ToneLevels::Bracket bracket = tone.bracket(t);
        ASSERT_GE(bracket.fraction, 0.0);
        ASSERT_LT(bracket.fraction, 1.0);
        const double lower = curve[bracket.lower];
        const double upper = curve[bracket.upper];
        ASSERT_NEAR(std::lerp(lower, upper, bracket.fraction), t, 2 * kFloatTolerance)
            << "t = " << t;
        // Nothing lies between the two.
        for (const double value : curve)
          ASSERT_TRUE(value <= lower + kFloatTolerance || value >= upper - kFloatTolerance);
      }
    }
  }
}

TEST(ToneLevels, DrawsAPlateauWithItsLowestCode) {
  const std::vector<double> curve{0, 0, 0, 0.5, 0.5, 1, 1, 1};
  const ToneLevels tone(curve);
  EXPECT_EQ(tone.bracket(0.0).lower, 0);
  EXPECT_EQ(tone.bracket(0.5).lower, 3);
  EXPECT_EQ(tone.bracket(0.25).upper, 3);
  EXPECT_EQ(tone.bracket(1.0).lower, 5);
  EXPECT_EQ(tone.bracket(1.0).fraction, 0.0);
}

TEST(ToneLevels, SeedsContainTheLevelWhateverTheSquareRootsRounding) {
  for (const auto& curve : curves(1024)) {
    const ToneLevels tone(curve);
    const auto levels = tone.levels();
    for (int i = 0; i < ToneLevels::kSeeds; ++i) {
      for (const double within : {-1e-3, 0.0, 0.5, 1.0, 1.0 + 1e-3}) {
        const double root = std::clamp((i + within) / ToneLevels::kSeeds, 0.0, 1.0);
        const double t = root * root;
        const auto above = std::upper_bound(levels.begin(), levels.end(), t) - levels.begin();
        const auto [low, high] = tone.seeds()[static_cast<std::size_t>(i)];
        EXPECT_LE(low, above - 1);
        EXPECT_GE(high, above - 1);
      }
    }
  }
}

}  // namespace
}  // namespace veneer::render
