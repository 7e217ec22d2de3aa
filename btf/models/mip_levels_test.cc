// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>

#include "btf/material.h"
#include "btf/models/internal_test_models.h"
#include "btf/texel_pyramid.h"

namespace veneer::btf {
namespace {

using testing::components_of;
using testing::dichromatic_set;
using testing::fit;
using testing::kHalfTolerance;
using testing::options_with;

// Of 5 x 3 texels.
constexpr int kMostLevels = 2;

FitOptions with_levels(int levels) {
  FitOptions options = options_with("2+2");
  options.mip_levels = levels;
  return options;
}

// Means of texels of two functions and any colours are of the same two functions.
TEST(MipLevels, AreExactWhereTheSampleIs) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", false);
  const SampleSetInfo& info = set.info();
  const auto material = fit("texel-colours", set, with_levels(kMostLevels));
  ASSERT_TRUE(material) << material.error().what;
  ASSERT_EQ((*material)->mip_levels(), kMostLevels);
  const TexelPyramid pyramid(info.width, info.height, kMostLevels);
  std::vector<float> wanted(static_cast<std::size_t>(info.pair_count()) * 3);
  std::vector<float> got(wanted.size());
  for (int texel = 0; texel < pyramid.texel_count(); ++texel) {
    pyramid_rgb(set, pyramid, texel, Part::kTotal, wanted);
    (*material)->reconstruct(texel, got);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      ASSERT_NEAR(wanted[i], got[i], kHalfTolerance) << "texel " << texel;
  }
}

TEST(MipLevels, ComeBackFromAFile) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", false);
  for (const int levels : {1, kMostLevels}) {
    const auto material = fit("texel-colours", set, with_levels(levels));
    ASSERT_TRUE(material) << material.error().what;
    const auto path = folder.path() / "a.safetensors";
    ASSERT_TRUE(save_material(**material, path, {}));
    const auto loaded = load_material(path);
    ASSERT_TRUE(loaded) << loaded.error().what;
    EXPECT_EQ((*loaded)->mip_levels(), levels);
    const int texels = TexelPyramid(5, 3, levels).texel_count();
    const Direction view = Direction(0.2, -0.1, 1.0).normalized();
    const Direction light = Direction(-0.5, 0.3, 1.0).normalized();
    for (int texel = 0; texel < texels; ++texel)
      EXPECT_EQ((*loaded)->radiance(texel, view, light), (*material)->radiance(texel, view, light));
  }
}

TEST(MipLevels, CostTheirShareOfATexel) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", false);
  const auto one = fit("texel-colours", set, with_levels(1));
  const auto two = fit("texel-colours", set, with_levels(2));
  ASSERT_TRUE(one && two);
  // Two texels more on fifteen: a cluster's number, 4 weights and 2 colours each.
  EXPECT_NEAR(
      (*two)->values_per_texel() - (*one)->values_per_texel(), 2.0 / 15 * (1 + 4 + 6), 1e-9);
}

TEST(MipLevels, AreRefusedWhereThereAreNone) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  for (const Model& model : models()) {
    FitOptions options = options_with(components_of(model, "2", "1+1"));
    options.mip_levels = model.name == "texel-colours" ? kMostLevels + 1 : 2;
    const auto material = fit(model.name, set, options);
    ASSERT_FALSE(material) << model.name;
    EXPECT_EQ(material.error().code, Errc::kInvalidOption);
    EXPECT_NE(material.error().what.find("mip_levels"), std::string::npos) << material.error().what;
  }
  for (const int levels : {0, -1, 16}) EXPECT_FALSE(fit("texel-colours", set, with_levels(levels)));
}

// What a file claims of its levels must hold for its tensors, and for its model.
TEST(MipLevels, AreRefusedFromFilesThatClaimThemWrongly) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const auto path = folder.path() / "a.safetensors";
  for (const char* model : {"texel-colours", "dichromatic-lpca"}) {
    const auto material = fit(model, set, with_levels(1));
    ASSERT_TRUE(material) << material.error().what;
    for (const char* claimed : {"2", "3", "0", "-1", "2147483648", "two"}) {
      ASSERT_TRUE(save_material(**material, path, {{"mip_levels", claimed}}));
      const auto loaded = load_material(path);
      ASSERT_FALSE(loaded) << model << ": " << claimed;
      EXPECT_EQ(loaded.error().code, Errc::kBadFormat);
    }
  }
}

}  // namespace
}  // namespace veneer::btf
