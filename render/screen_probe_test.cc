// SPDX-License-Identifier: Apache-2.0
#include "render/screen_probe.h"

#include <gtest/gtest.h>

#include <map>
#include <numeric>

namespace veneer::render {
namespace {

using Eigen::Vector2d;

constexpr int kWidth = 4;
constexpr int kHeight = 3;

double total(const std::vector<ScreenQuery::Share>& shares) {
  return std::accumulate(shares.begin(), shares.end(), 0.0, [](double sum, const auto& share) {
    return sum + share.part;
  });
}

TEST(SharesOf, OneRaySeesTheTexelAtTheCentreInAnyRepeat) {
  for (const double repeat : {-2.0, 0.0, 3.0}) {
    const auto shares = shares_of(Vector2d(repeat + 0.6, repeat + 0.4),
                                  Vector2d(0.5, 0),
                                  Vector2d(0, 0.5),
                                  kWidth,
                                  kHeight,
                                  1);
    ASSERT_EQ(shares.size(), 1U);
    EXPECT_EQ(shares[0].texel, 1 * kWidth + 2);
    EXPECT_EQ(shares[0].part, 1.0);
  }
}

TEST(SharesOf, APixelOfTheWholeSampleSeesEveryTexelAlike) {
  for (const Vector2d& at : {Vector2d(0.5, 0.5), Vector2d(-0.3, 7.9)}) {
    const auto shares = shares_of(at, Vector2d(1, 0), Vector2d(0, 1), kWidth, kHeight, 24);
    ASSERT_EQ(shares.size(), static_cast<std::size_t>(kWidth * kHeight));
    for (const auto& share : shares) EXPECT_NEAR(share.part, 1.0 / (kWidth * kHeight), 1.0 / 24);
    EXPECT_NEAR(total(shares), 1.0, 1e-12);
  }
}

TEST(SharesOf, APixelAcrossABorderSeesBothSides) {
  // A quarter of a texel before the border, one texel wide: a quarter beyond it.
  const auto shares = shares_of(Vector2d(0.25 - 0.25 / kWidth, 0.5),
                                Vector2d(1.0 / kWidth, 0),
                                Vector2d(0, 1e-6),
                                kWidth,
                                kHeight,
                                16);
  ASSERT_EQ(shares.size(), 2U);
  EXPECT_DOUBLE_EQ(shares[0].part, 0.75);
  EXPECT_DOUBLE_EQ(shares[1].part, 0.25);
}

TEST(SharesOf, APixelWithoutExtentSeesOneTexel) {
  const auto shares =
      shares_of(Vector2d(1.0, 1.0), Vector2d::Zero(), Vector2d::Zero(), kWidth, kHeight, 8);
  ASSERT_EQ(shares.size(), 1U);
  EXPECT_EQ(shares[0].texel, 0);
}

}  // namespace
}  // namespace veneer::render
