// SPDX-License-Identifier: Apache-2.0
#include "btf/texel_pyramid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "base/testing/temporary_folder.h"
#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

using Size = std::pair<int, int>;

TEST(TexelPyramid, EveryTexelHasAPlaceOfItsOwnInsideTheTexture) {
  for (const auto& [width, height] :
       {Size{1, 1}, Size{1, 9}, Size{2, 3}, Size{5, 3}, Size{7, 13}, Size{64, 64}, Size{96, 31}})
    for (int levels = 1; levels <= TexelPyramid::most_levels(width, height); ++levels) {
      SCOPED_TRACE(fmt::format("{} x {}, {} levels", width, height, levels));
      const TexelPyramid pyramid(width, height, levels);
      std::set<std::pair<int, int>> places;
      for (int texel = 0; texel < pyramid.texel_count(); ++texel) {
        const auto [x, y] = pyramid.place(texel);
        EXPECT_TRUE(x >= 0 && x < pyramid.texture_width()) << "texel " << texel << ": " << x;
        EXPECT_TRUE(y >= 0 && y < pyramid.texture_height()) << "texel " << texel << ": " << y;
        EXPECT_TRUE(places.insert({x, y}).second) << "texel " << texel << " stands on another";
      }
      EXPECT_EQ(pyramid.level_of(0), 0);
      EXPECT_EQ(pyramid.level_of(pyramid.texel_count() - 1), levels - 1);
    }
}

TEST(TexelPyramid, ItsLastPossibleLevelIsOneTexelWideOrHigh) {
  for (const auto& [width, height] : {Size{1, 1}, Size{1, 9}, Size{5, 3}, Size{64, 64}}) {
    const TexelPyramid pyramid(width, height, TexelPyramid::most_levels(width, height));
    EXPECT_EQ(std::min(pyramid.width(pyramid.levels() - 1), pyramid.height(pyramid.levels() - 1)),
              1);
  }
}

// Whatever the size: each level's mean is the sample's mean, and a level of constants is constant.
TEST(TexelPyramid, LevelsKeepTheMean) {
  // Float sums of 7 x 6 values up to 2.
  constexpr float kRounding = 1e-5F;
  const TemporaryFolder folder;
  SampleSetInfo info;
  info.width = 7;
  info.height = 6;
  info.views = testing::ring(3, 0.9);
  info.lights = testing::ring(4, 1.0);
  info.source = "a formula";
  const SampleSet set = testing::make_set(
      folder.path() / "a.btfset", info, [](int texel, int view, int light, int channel) {
        return channel == 2 ? 0.5F
                            : static_cast<float>((texel * 5 + view * 3 + light + channel) % 8) / 4;
      });
  const TexelPyramid pyramid(info.width, info.height, 3);
  const auto values = static_cast<std::size_t>(info.pair_count()) * 3;
  std::vector<float> rgb(values);
  std::vector<std::vector<float>> means;
  for (int level = 0; level < pyramid.levels(); ++level) {
    std::vector<float>& mean = means.emplace_back(values, 0.0F);
    const int count = pyramid.first(level + 1) - pyramid.first(level);
    for (int texel = pyramid.first(level); texel < pyramid.first(level + 1); ++texel) {
      pyramid_rgb(set, pyramid, texel, Part::kTotal, rgb);
      for (std::size_t i = 0; i < values; ++i) {
        mean[i] += rgb[i] / static_cast<float>(count);
        if (i % 3 == 2) {
          EXPECT_NEAR(rgb[i], 0.5F, kRounding);
        }
      }
    }
    for (std::size_t i = 0; i < values; ++i) EXPECT_NEAR(mean[i], means[0][i], kRounding);
  }
}

// Of even sizes a texel is the mean of the four under it.
TEST(TexelPyramid, EvenLevelsAverageFour) {
  const TemporaryFolder folder;
  SampleSetInfo info;
  info.width = 4;
  info.height = 2;
  info.views = info.lights = testing::ring(3, 0.9);
  info.source = "a formula";
  const SampleSet set =
      testing::make_set(folder.path() / "a.btfset", info, [](int texel, int, int light, int) {
        return static_cast<float>(texel + light);
      });
  const TexelPyramid pyramid(info.width, info.height, 2);
  std::vector<float> rgb(static_cast<std::size_t>(info.pair_count()) * 3);
  pyramid_rgb(set, pyramid, 9, Part::kTotal, rgb);
  EXPECT_FLOAT_EQ(rgb[0], (2 + 3 + 6 + 7) / 4.0F);
}

}  // namespace
}  // namespace veneer::btf
