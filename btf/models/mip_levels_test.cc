// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "btf/material.h"
#include "btf/models/internal_test_models.h"
#include "btf/models/packed_lpca.h"
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

// What a model would be that has nothing but its two functions.
class TwoFunctions final : public Material {
 public:
  explicit TwoFunctions(const PackedLpca& functions) : functions_(functions) {}
  std::string_view model() const override { return "two functions"; }
  int width() const override { return functions_.frame().width; }
  int height() const override { return functions_.frame().height; }
  const DirectionSet& views() const override { return functions_.frame().views; }
  const DirectionSet& lights() const override { return functions_.frame().lights; }
  void reconstruct(int, std::span<float>) const override {}
  Eigen::Vector3d radiance(int, const Direction&, const Direction&) const override {
    return Eigen::Vector3d::Zero();
  }
  ModelShader shader() const override { return {}; }
  double values_per_texel() const override { return functions_.values_per_texel(); }
  Contents contents() const override {
    Contents contents;
    functions_.add_to(contents);
    return contents;
  }

 private:
  const PackedLpca& functions_;
};

// No model has both yet: all that clusters of a function's own and the half angle say of texels
// they say of those of the mip levels too.
TEST(MipLevels, GoWithSeparateClustersAndTheHalfAngle) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "a.safetensors";
  const auto fitted = FittedPairs::of(testing::small_info(), nullptr);
  ASSERT_TRUE(fitted) << fitted.error().what;
  const MaterialFrame& frame = fitted->frame();
  const TexelPyramid pyramid(frame.width, frame.height, kMostLevels);
  // Two kinds of each function, in all four pairings.
  const auto read = [&](int texel, std::span<float> first, std::span<float> second) {
    std::size_t i = 0;
    for (const Direction& v : frame.views)
      for (const Direction& l : frame.lights) {
        first[i] = static_cast<float>(0.5 * l.z() * (texel % 2 == 0 ? 1.0 : 1.0 - 0.8 * v.z()));
        const double exponent = texel / 2 % 2 == 0 ? 4.0 : 40.0;
        second[i++] =
            static_cast<float>(0.4 * l.z() * std::pow((v + l).normalized().z(), exponent));
      }
  };
  const std::vector<Eigen::half> colours(3 * static_cast<std::size_t>(pyramid.texel_count()));
  const auto fit_functions = [&](bool separate) {
    SilentProgress progress;
    return PackedLpca::fit(
        *fitted,
        options_with("1+1"),
        {.components = {1, 1}, .angular = 12, .mip_levels = kMostLevels, .separate = separate},
        read,
        progress);
  };
  const auto joint = fit_functions(false);
  const auto separate = fit_functions(true);
  ASSERT_TRUE(joint && separate);
  EXPECT_NEAR(separate->values_per_texel() - joint->values_per_texel(), 17.0 / 15, 1e-9);
  Pcg32 random(7);
  for (const bool half_angle : {false, true}) {
    const PackedLpca functions =
        half_angle ? separate->with_half_angle(read, *fitted, alone()) : *separate;
    ASSERT_TRUE(save_material(TwoFunctions(functions), path, {}));
    const auto file = SafetensorsFile::open(path);
    ASSERT_TRUE(file) << file.error().what;
    const PackedLpca::Layout known{.separate = true, .half_angle = half_angle};
    const auto loaded = PackedLpca::load(*file, known, true);
    ASSERT_TRUE(loaded) << loaded.error().what;
    const auto refused = PackedLpca::load(*file, known, false);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kBadFormat);
    EXPECT_EQ(loaded->shader(colours).textures[0].height, pyramid.texture_height());

    const auto pairs = static_cast<std::size_t>(frame.pair_count());
    std::vector<float> wanted(2 * pairs);
    std::vector<float> got(2 * pairs);
    const auto halves = [pairs](std::vector<float>& values) {
      return std::pair{std::span(values).first(pairs), std::span(values).last(pairs)};
    };
    for (int texel = 0; texel < pyramid.texel_count(); ++texel) {
      read(texel, halves(wanted).first, halves(wanted).second);
      loaded->reconstruct(texel, halves(got).first, halves(got).second);
      for (std::size_t i = 0; i < 2 * pairs; ++i)  // and the grid of half angles
        ASSERT_NEAR(
            got[i], wanted[i], half_angle && i >= pairs ? 4 * kHalfTolerance : kHalfTolerance)
            << "texel " << texel;
      const Direction view = testing::random_direction(random);
      const Direction light = testing::random_direction(random);
      EXPECT_EQ(loaded->evaluate(texel, view, light), functions.evaluate(texel, view, light));
    }
  }
}

}  // namespace
}  // namespace veneer::btf
