// SPDX-License-Identifier: Apache-2.0
#include "btf/models/cluster_volume.h"

#include <gtest/gtest.h>

#include <vector>

namespace veneer::btf {
namespace {

GridShape square(int nodes) { return {{}, nodes, nodes}; }

constexpr int kMostSide = 2048;  // of a volume, in every GL 4.5

TEST(ClusterVolume, GivesEveryPairOfNodesATexelOfItsOwnWithinWhatGpusTake) {
  struct Case {
    int clusters, view_nodes, light_nodes, storeys;
  };
  for (const auto& [clusters, a, b, storeys] : {Case{1, 1, 4, 1},
                                                Case{1, 16, 16, 3},
                                                Case{3, 5, 4, 2},
                                                Case{32, 8, 4, 8},
                                                Case{256, 32, 4, 2}}) {
    const ClusterVolume volume(clusters, square(a), square(b), storeys);
    EXPECT_LE(volume.width(), kMostSide);
    EXPECT_LE(volume.height(), kMostSide);
    EXPECT_EQ(volume.depth(), a == 1 ? 1 : b * b);
    std::vector<bool> taken(volume.texel_count());
    for (int k = 0; k < clusters; ++k)
      for (int s = 0; s < storeys; ++s)
        for (int v = 0; v < a * a; ++v)
          for (int l = 0; l < b * b; ++l) {
            const std::size_t texel = volume.texel(k, s, v, l);
            ASSERT_LT(texel, taken.size());
            ASSERT_FALSE(taken[texel]);
            taken[texel] = true;
          }
  }
}

// Grids of any sides, of which one may be a point or a line: then one fetch has all of them.
TEST(ClusterVolume, TakesGridsOfAnySidesAndSaysHowManyFetchesTheyTake) {
  struct Case {
    GridShape views, lights;
    int fetches;
  };
  for (const auto& [views, lights, fetches] : {Case{{{}, 3, 4}, {{}, 2, 5}, 2},
                                               Case{{{}, 3, 4}, {{}, 1, 1}, 1},
                                               Case{{{}, 3, 4}, {{}, 1, 6}, 1},
                                               Case{{{}, 3, 4}, {{}, 6, 1}, 1},
                                               Case{{{}, 1, 4}, {{}, 3, 3}, 2},
                                               Case{{{}, 1, 1}, {{}, 3, 4}, 1},
                                               Case{{{}, 1, 1}, {{}, 1, 1}, 1}}) {
    const ClusterVolume volume(5, views, lights, 2);
    EXPECT_EQ(volume.fetches(), fetches);
    std::vector<bool> taken(volume.texel_count());
    for (int k = 0; k < 5; ++k)
      for (int s = 0; s < 2; ++s)
        for (int v = 0; v < views.count(); ++v)
          for (int l = 0; l < lights.count(); ++l) {
            const std::size_t texel = volume.texel(k, s, v, l);
            ASSERT_LT(texel, taken.size());
            ASSERT_FALSE(taken[texel]);
            taken[texel] = true;
          }
  }
}

// The filter must find a function's neighbouring nodes in neighbouring texels.
TEST(ClusterVolume, KeepsNeighboursTogether) {
  const ClusterVolume volume(40, square(6), square(5), 2);
  const auto width = static_cast<std::size_t>(volume.width());
  const std::size_t slice = width * static_cast<std::size_t>(volume.height());
  for (const int k : {0, 7, 39}) {
    EXPECT_EQ(volume.texel(k, 1, 8, 3), volume.texel(k, 1, 7, 3) + 1);
    EXPECT_EQ(volume.texel(k, 1, 13, 3), volume.texel(k, 1, 7, 3) + width);
    EXPECT_EQ(volume.texel(k, 1, 7, 4), volume.texel(k, 1, 7, 3) + slice);
  }
}

TEST(ClusterVolume, EvenTheLargestMaterialFitsInItsSides) {
  const ClusterVolume volume(256, square(32), square(32), 16);
  EXPECT_LE(volume.width(), kMostSide);
  EXPECT_LE(volume.height(), kMostSide);
  EXPECT_LE(volume.depth(), kMostSide);
}

TEST(ClusterVolume, RefusesMoreBytesThanItsLimitAndSaysWhatToLower) {
  EXPECT_TRUE(ClusterVolume::check(double(ClusterVolume::kMostBytes), Errc::kInvalidOption, "fit"));
  const Status refused =
      ClusterVolume::check(1.01 * double(ClusterVolume::kMostBytes), Errc::kInvalidOption, "fit");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  EXPECT_NE(refused.error().what.find("angular"), std::string::npos) << refused.error().what;
}

}  // namespace
}  // namespace veneer::btf
