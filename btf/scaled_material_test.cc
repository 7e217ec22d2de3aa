// SPDX-License-Identifier: Apache-2.0
#include "btf/scaled_material.h"

#include <gtest/gtest.h>

#include <cmath>

#include "btf/interpolated_set.h"
#include "btf/models/internal_test_models.h"

namespace veneer::btf {
namespace {

using testing::components_of;
using testing::dichromatic;
using testing::fit;
using testing::make_set;
using testing::options_with;
using testing::random_direction;
using testing::small_info;

SampleSet set_with_scale(const TemporaryFolder& folder, double scale) {
  SampleSetInfo info = small_info(true);
  info.scale = scale;
  return make_set(folder.path() / fmt::format("{}.btfset", scale),
                  info,
                  [info](int texel, int view, int light, int channel) {
                    return dichromatic(info, texel, view, light, channel);
                  });
}

TEST(ScaleOfASet, IsReadBackAndMultipliesWhatIsReadAndInterpolated) {
  const TemporaryFolder folder;
  const SampleSet one = set_with_scale(folder, 1.0);
  std::vector<float> wanted(static_cast<std::size_t>(one.info().pair_count()) * 3);
  std::vector<float> got(wanted.size());
  for (const double scale : {std::ldexp(1.0, -20), 0.1, 3.0, kLeastScale, kMostScale}) {
    const SampleSet set = set_with_scale(folder, scale);
    ASSERT_EQ(set.info().scale, scale);
    for (const Part part : {Part::kTotal, Part::kSpecular, Part::kDiffuse}) {
      one.rgb(3, part, wanted);
      set.rgb(3, part, got);
      for (std::size_t i = 0; i < got.size(); ++i)
        ASSERT_EQ(got[i], wanted[i] * static_cast<float>(scale));
      set.with_scale(1.0).rgb(3, part, got);
      ASSERT_EQ(got, wanted);
    }
    const Direction view = Direction(0.2, 0.1, 0.9).normalized();
    const Direction light = Direction(-0.4, 0.3, 0.5).normalized();
    const Eigen::Vector3d reference = scale * InterpolatedSet(one).radiance(2, view, light);
    EXPECT_TRUE(InterpolatedSet(set).radiance(2, view, light).isApprox(reference, 1e-14));
  }
}

TEST(ScaleOfASet, IsChosenSoThatTheLargestSampleFits) {
  EXPECT_EQ(scale_for(0.0), 1.0);
  EXPECT_EQ(scale_for(std::nan("")), 1.0);
  EXPECT_EQ(scale_for(HUGE_VAL), 1.0);
  for (const double largest : {0.1, 1.0, 1.3, 1000.0, 65504.0}) EXPECT_EQ(scale_for(largest), 1.0);
  for (const double largest : {1e-20, 1e-5, 0.01, 65505.0, 1e9, 1e29}) {
    int exponent = 0;
    EXPECT_EQ(std::frexp(scale_for(largest), &exponent), 0.5) << largest;
    EXPECT_GE(largest / scale_for(largest), 16384.0);
    EXPECT_LT(largest / scale_for(largest), 32768.0);
  }
  EXPECT_EQ(scale_for(1e-40), kLeastScale);
  EXPECT_EQ(scale_for(1e200), kMostScale);
}

TEST(ScaleOfASet, TheLargestStoredNumberIsFoundWhateverItsSignAndBesideNan) {
  const TemporaryFolder folder;
  const SampleSet set =
      make_set(folder.path() / "a.btfset", small_info(), [](int texel, int, int light, int) {
        if (texel == 2) return light == 1 ? std::nanf("") : 0.25F;
        return texel == 7 && light == 3 ? -31.0F : 0.5F;
      });
  EXPECT_EQ(set.largest_stored(0, 15), 31.0);
  EXPECT_EQ(set.largest_stored(0, 7), 0.5);
  EXPECT_EQ(set.largest_stored(2, 1), 0.25);
  EXPECT_EQ(set.largest_stored(2, 0), 0.0);
}

TEST(ScaleOfASet, IsRefusedWhereFloatsWouldOverflowOrVanish) {
  const TemporaryFolder folder;
  for (const double scale : {0.0, -1.0, 1e-26, 1e26, HUGE_VAL, std::nan("")}) {
    SampleSetInfo info = small_info();
    info.scale = scale;
    const auto writer = SampleSetWriter::create(folder.path() / "a.btfset", info);
    ASSERT_FALSE(writer) << scale;
    EXPECT_EQ(writer.error().code, Errc::kInvalidOption);
    EXPECT_NE(writer.error().what.find("the scale is"), std::string::npos) << writer.error().what;
  }
}

TEST(ScaleOfASet, SamplesThatDoNotFitAreCutAndCounted) {
  const TemporaryFolder folder;
  SampleSetInfo info = small_info();
  info.scale = 0.5;
  auto writer = SampleSetWriter::create(folder.path() / "a.btfset", info);
  ASSERT_TRUE(writer) << writer.error().what;
  EXPECT_EQ(static_cast<float>(writer->stored(1.0F)), 2.0F);
  EXPECT_EQ(static_cast<float>(writer->stored(32752.0F)), 65504.0F);
  EXPECT_EQ(writer->clamped(), 0);
  EXPECT_EQ(writer->clamped_remark(), "");
  EXPECT_EQ(static_cast<float>(writer->stored(32768.0F)), 65504.0F);
  EXPECT_EQ(static_cast<float>(writer->stored(-HUGE_VALF)), -65504.0F);
  EXPECT_EQ(writer->clamped(), 2);
  EXPECT_EQ(writer->clamped_remark(), "2 samples beyond what the set can hold were cut to that");
  EXPECT_TRUE((Eigen::numext::isnan)(writer->stored(std::nanf(""))));
}

// The scale is outside of the model: whatever the model, and to the last bit for powers of two.
TEST(ScaledMaterials, AreTheMaterialOfTheStoredNumbersTimesTheScale) {
  const TemporaryFolder folder;
  const SampleSet one = set_with_scale(folder, 1.0);
  const std::filesystem::path file = folder.path() / "a.safetensors";
  for (const Model& model : models()) {
    const FitOptions options = options_with(components_of(model, "2", "1+1"));
    const auto plain = fit(model.name, one, options);
    ASSERT_TRUE(plain) << plain.error().what;
    EXPECT_FALSE((*plain)->contents().metadata.contains("scale"));
    for (const int k : {-20, -3, 4, 20}) {
      const double scale = std::ldexp(1.0, k);
      const auto scaled = fit(model.name, set_with_scale(folder, scale), options);
      ASSERT_TRUE(scaled) << scaled.error().what;
      ASSERT_TRUE(save_material(**scaled, file, {}));
      const auto loaded = load_material(file);
      ASSERT_TRUE(loaded) << loaded.error().what;
      for (const Material* material : {scaled->get(), loaded->get()}) {
        EXPECT_EQ(material->model(), model.name);
        EXPECT_EQ(material->has_specular_term(), (*plain)->has_specular_term());
        EXPECT_EQ(material->values_per_texel(), (*plain)->values_per_texel());
        std::vector<float> wanted(static_cast<std::size_t>(one.info().pair_count()) * 3);
        std::vector<float> got(wanted.size());
        (*plain)->reconstruct(4, wanted);
        material->reconstruct(4, got);
        for (std::size_t i = 0; i < got.size(); ++i)
          ASSERT_EQ(got[i], wanted[i] * static_cast<float>(scale));
        Pcg32 random(7);
        for (int i = 0; i < 100; ++i) {
          const Direction view = random_direction(random, -0.05);
          const Direction light = random_direction(random, -0.1);
          ASSERT_EQ(material->radiance(i % 15, view, light),
                    scale * (*plain)->radiance(i % 15, view, light))
              << model.name;
          ASSERT_EQ(material->diffuse_radiance(i % 15, view, light),
                    scale * (*plain)->diffuse_radiance(i % 15, view, light));
        }
      }
    }
  }
}

TEST(ScaledMaterials, AreRefusedWhereTheStoredScaleIsDamaged) {
  const TemporaryFolder folder;
  const SampleSet set = set_with_scale(folder, 1.0);
  const auto material = fit("phong", set, options_with("1"));
  ASSERT_TRUE(material) << material.error().what;
  const std::filesystem::path file = folder.path() / "a.safetensors";
  for (const char* scale : {"", "0", "-1", "nan", "inf", "1e34", "1e-34", "2x", " 2"}) {
    ASSERT_TRUE(save_material(**material, file, {{"scale", scale}}));
    const auto loaded = load_material(file);
    ASSERT_FALSE(loaded) << scale;
    EXPECT_EQ(loaded.error().code, Errc::kBadFormat);
    EXPECT_NE(loaded.error().what.find("scale is"), std::string::npos) << loaded.error().what;
  }
}

}  // namespace
}  // namespace veneer::btf
