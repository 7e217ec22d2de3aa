// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "btf/internal_test_sets.h"
#include "btf/interpolated_set.h"
#include "btf/material.h"
#include "btf/models/internal_test_models.h"

// Laws that hold for every model, and those of each.
namespace veneer::btf {
namespace {

namespace fs = std::filesystem;
using testing::components_of;
using testing::cosine;
using testing::dichromatic;
using testing::dichromatic_set;
using testing::fit;
using testing::kHalfTolerance;
using testing::largest_error;
using testing::make_set;
using testing::options_with;
using testing::random_direction;
using testing::ring;
using testing::shine;
using testing::small_info;

bool has_form(const Model& model, std::string_view form) {
  return form.empty() || model.name == "dichromatic-lpca";
}

bool is_formula_of_view(const Model& model) {
  return model.name == "lafortune" || model.name == "layered" || model.name == "scaled-lafortune" ||
         model.name == "phong";
}

TEST(Models, AreFoundByNameAndOthersAreRefusedWithTheList) {
  for (const Model& model : models()) EXPECT_EQ(*find_model(model.name), &model);
  const auto unknown = find_model("lpac");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, Errc::kInvalidOption);
  for (const Model& model : models())
    EXPECT_NE(unknown.error().what.find(model.name), std::string::npos) << unknown.error().what;
}

TEST(Models, LpcaIsExactWithAsManyComponentsAsRank) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", false);
  const auto material = fit("lpca", set, options_with("4", 1));
  ASSERT_TRUE(material) << material.error().what;
  EXPECT_LT(largest_error(set, **material), kHalfTolerance);
  // Measured directions are drawn as they are.
  const SampleSetInfo& info = set.info();
  std::vector<float> rgb(static_cast<std::size_t>(info.pair_count()) * 3);
  set.rgb(5, Part::kTotal, rgb);
  for (std::size_t v = 0; v < info.views.size(); ++v)
    for (std::size_t l = 0; l < info.lights.size(); ++l)
      EXPECT_NEAR((*material)->radiance(5, info.views[v], info.lights[l])[1],
                  double(rgb[(v * info.lights.size() + l) * 3 + 1]),
                  kHalfTolerance);
}

TEST(Models, TexelColoursAreExactForTwoColoursATexel) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", false);
  const auto material = fit("texel-colours", set, options_with("2+2"));
  ASSERT_TRUE(material) << material.error().what;
  EXPECT_LT(largest_error(set, **material), kHalfTolerance);
}

TEST(Models, DichromaticIsExactForADichromaticMaterial) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  for (const char* form : {"", "learned", "ratio"}) {
    FitOptions options = options_with("1+1");
    options.form = form;
    const auto material = fit("dichromatic-lpca", set, options);
    ASSERT_TRUE(material) << material.error().what;
    EXPECT_LT(largest_error(set, **material), kHalfTolerance) << form;
    EXPECT_EQ((*material)->contents().metadata.at("masked_texels"), "0");
  }
}

// A body that changes its hue with the light has no one colour. The learned one is the best in the
// squares for every texel, whatever the reference pair happens to show.
TEST(Models, DichromaticLearnsAColourNeverWorseThanTheReferences) {
  const TemporaryFolder folder;
  const SampleSetInfo info = small_info(true);
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [&](int texel, int view, int light, int channel) {
        if (channel < 3) return 0.0F;
        const bool at_reference = view == 0 && light == 0;
        const double hue = at_reference ? 0.2 * ((texel + channel) % 3) : 0.03 * (channel - 3);
        return static_cast<float>((0.3 + hue) * cosine(info, light));
      });
  const auto squares = [&](const char* form) {
    FitOptions options = options_with("8+1", 4);  // enough for every scalar to be exact
    options.form = form;
    const auto material = fit("dichromatic-lpca", set, options);
    EXPECT_TRUE(material) << material.error().what;
    std::vector<float> wanted(static_cast<std::size_t>(info.pair_count()) * 3);
    std::vector<float> got(wanted.size());
    double sum = 0.0;
    for (int texel = 0; texel < info.texel_count(); ++texel) {
      set.rgb(texel, Part::kTotal, wanted);
      (*material)->reconstruct(texel, got);
      for (std::size_t i = 0; i < got.size(); ++i) sum += std::pow(double(got[i] - wanted[i]), 2);
    }
    return sum;
  };
  EXPECT_LT(squares("learned"), 0.5 * squares("ratio"));
}

TEST(Models, SubtractiveFormIsExactWhereShadowsHaveOneColour) {
  // Every texel's body colour is the same up to its strength, so what shadows take is one colour.
  const TemporaryFolder folder;
  const SampleSetInfo info = small_info(true);
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [&](int texel, int view, int light, int channel) {
        const double body = (0.2 + 0.05 * texel) * (channel % 3 + 1) / 3.0;
        return static_cast<float>(channel >= 3 ? body * cosine(info, light)
                                               : 0.2 * shine(info, view, light));
      });
  FitOptions options = options_with("1+1");
  options.form = "subtractive";
  const auto material = fit("dichromatic-lpca", set, options);
  ASSERT_TRUE(material) << material.error().what;
  EXPECT_LT(largest_error(set, **material), kHalfTolerance);
}

TEST(Models, DichromaticMasksTexelsWithoutDiffuseReference) {
  const TemporaryFolder folder;
  const SampleSetInfo info = small_info(true);
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [&](int texel, int view, int light, int channel) {
        return texel == 3 && channel >= 3 ? 0.0F : dichromatic(info, texel, view, light, channel);
      });
  FitOptions options = options_with("1+1");
  for (const char* form : {"learned", "ratio"}) {
    options.form = form;
    const auto material = fit("dichromatic-lpca", set, options);
    ASSERT_TRUE(material) << material.error().what;
    EXPECT_EQ((*material)->contents().metadata.at("masked_texels"), "1") << form;
    EXPECT_LT(largest_error(set, **material), kHalfTolerance) << form;
  }
  // The third form divides by nothing and masks none.
  options.form = "subtractive";
  const auto subtractive = fit("dichromatic-lpca", set, options);
  ASSERT_TRUE(subtractive) << subtractive.error().what;
  EXPECT_EQ((*subtractive)->contents().metadata.at("masked_texels"), "0");
}

TEST(Models, RefuseTexturesThatGpusMightNotTakeBeforeTheyFit) {
  const TemporaryFolder folder;
  SampleSetInfo wide = small_info(true);
  wide.width = 16385;
  wide.height = 1;
  wide.views = {Direction::UnitZ()};
  wide.lights = {Direction::UnitZ()};
  const auto sample = [](int, int, int, int) { return 0.5F; };
  const SampleSet too_wide = make_set(folder.path() / "wide.btfset", wide, sample);
  for (const Model& model : models()) {
    const auto refused = fit(model.name, too_wide, options_with(components_of(model, "1", "1+1")));
    ASSERT_FALSE(refused) << model.name;
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption) << refused.error().what;
  }
  // Two terms of 16 components and two colours take five words a texel.
  wide.width = 3300;
  const SampleSet many_words = make_set(folder.path() / "words.btfset", wide, sample);
  EXPECT_FALSE(fit("texel-colours", many_words, options_with("16+16", 1)));
  // A row for each component and view.
  SampleSetInfo views = small_info(true);
  views.width = views.height = 1;
  views.lights = {Direction::UnitZ()};
  views.views = ring(1100, 1.0);
  const SampleSet many_views = make_set(folder.path() / "views.btfset", views, sample);
  const auto rows = fit("lpca", many_views, options_with("16", 1));
  ASSERT_FALSE(rows);
  EXPECT_EQ(rows.error().code, Errc::kInvalidOption) << rows.error().what;
  EXPECT_TRUE(fit("lpca", many_views, options_with("4", 1)));
}

TEST(Models, DichromaticRefusesAnUnpolarisedSetAndSaysWhatToDo) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", false);
  const auto material = fit("dichromatic-lpca", set, options_with("1+1"));
  ASSERT_FALSE(material);
  EXPECT_EQ(material.error().code, Errc::kInvalidOption);
  EXPECT_NE(material.error().what.find("texel-colours"), std::string::npos)
      << material.error().what;
}

TEST(Models, RefuseOptionsThatTheyCannotDo) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const std::vector<std::pair<std::string, std::string>> bad{{"lpca", "3+1"},
                                                             {"lpca", "0"},
                                                             {"lpca", ""},
                                                             {"lpca", "4x"},
                                                             {"lpca", "99"},
                                                             {"texel-colours", "1"},
                                                             {"texel-colours", "3+"},
                                                             {"texel-colours", "1+1+1"},
                                                             {"dichromatic-lpca", "-2"}};
  for (const auto& [model, components] : bad) {
    const auto material = fit(model, set, options_with(components));
    ASSERT_FALSE(material) << model << " " << components;
    EXPECT_EQ(material.error().code, Errc::kInvalidOption) << material.error().what;
    EXPECT_NE(material.error().what.find("components"), std::string::npos) << material.error().what;
  }
  FitOptions options = options_with("4");
  options.form = "subtractive";
  EXPECT_FALSE(fit("lpca", set, options));
  options = options_with("4");
  options.clusters = 0;
  EXPECT_FALSE(fit("lpca", set, options));
  options.clusters = 257;
  EXPECT_FALSE(fit("texel-colours", set, options));
}

TEST(Models, RefuseSamplesThatAreNotFinite) {
  const TemporaryFolder folder;
  const SampleSet set =
      make_set(folder.path() / "a.btfset", small_info(true), [](int texel, int, int light, int) {
        return texel == 5 && light == 2 ? std::numeric_limits<float>::quiet_NaN() : 0.5F;
      });
  for (const Model& model : models()) {
    const auto two = fit(model.name, set, options_with(components_of(model, "1", "1+1")));
    ASSERT_FALSE(two) << model.name;
    EXPECT_EQ(two.error().code, Errc::kBadFormat) << two.error().what;
  }
}

TEST(Models, ZeroSamplesGiveZeroAndOneTexelIsEnough) {
  const TemporaryFolder folder;
  SampleSetInfo info = small_info(true);
  const SampleSet black =
      make_set(folder.path() / "0.btfset", info, [](int, int, int, int) { return 0.0F; });
  info.width = info.height = 1;
  const SampleSet one =
      make_set(folder.path() / "1.btfset", info, [&](int texel, int view, int light, int channel) {
        return dichromatic(info, texel, view, light, channel);
      });
  for (const Model& model : models()) {
    const FitOptions options = options_with(components_of(model, "4", "2+2"), 32);
    const auto dark = fit(model.name, black, options);
    ASSERT_TRUE(dark) << dark.error().what;
    EXPECT_EQ(largest_error(black, **dark), 0.0) << model.name;
    const auto single = fit(model.name, one, options);
    ASSERT_TRUE(single) << single.error().what;
    // Lobes are a shape of their own: only models of components hold any single texel.
    if (model.terms > 0) {
      EXPECT_LT(largest_error(one, **single), kHalfTolerance) << model.name;
    }
  }
}

TEST(Models, DrawNothingFromBelowAndFiniteValuesEverywhere) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  Pcg32 random(1);
  for (const Model& model : models()) {
    for (const char* form : {"", "ratio", "subtractive"}) {
      FitOptions options = options_with(components_of(model, "2", "1+1"));
      options.form = form;
      const auto material = fit(model.name, set, options);
      ASSERT_EQ(material.has_value(), has_form(model, form)) << model.name << form;
      if (!material) continue;
      for (int i = 0; i < 2000; ++i) {
        const Direction view = random_direction(random, -0.05);
        const Direction light = random_direction(random, -0.2);
        const Eigen::Vector3d rgb = (*material)->radiance(i % 12, view, light);
        EXPECT_TRUE(rgb.allFinite() && rgb.minCoeff() >= 0.0) << model.name;
        if (light.z() <= 0.0) {
          EXPECT_EQ(rgb, Eigen::Vector3d::Zero()) << model.name;
        }
      }
      // Towards the horizon light fades to nothing.
      EXPECT_LT((*material)
                    ->radiance(3, Direction::UnitZ(), Direction(1.0, 0.0, 1e-6).normalized())
                    .norm(),
                1e-3)
          << model.name << form;
    }
  }
}

TEST(Models, DrawnValuesFollowTheInterpolatedSet) {
  // What the grid or the lookup adds to a fit that is exact at the measured directions.
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const InterpolatedSet reference(set);
  for (const Model& model : models()) {
    FitOptions options = options_with(components_of(model, "2", "1+1"), 12);
    options.angular = 24;
    const auto material = fit(model.name, set, options);
    ASSERT_TRUE(material) << material.error().what;
    Pcg32 random(2);
    double mean = 0.0;
    constexpr int kSamples = 4000;
    for (int i = 0; i < kSamples; ++i) {
      const Direction view = random_direction(random);
      const Direction light = random_direction(random, 1e-3);
      mean += ((*material)->radiance(i % 12, view, light) - reference.radiance(i % 12, view, light))
                  .cwiseAbs()
                  .maxCoeff() /
              kSamples;
    }
    if (model.terms > 0) {
      EXPECT_LT(mean, 5e-3) << model.name;
    }
  }
}

TEST(Models, AFixedViewIsALegalSet) {
  const TemporaryFolder folder;
  SampleSetInfo info = small_info(true);
  info.views = {Direction::UnitZ()};
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [&](int texel, int view, int light, int channel) {
        return dichromatic(info, texel, view, light, channel);
      });
  for (const Model& model : models()) {
    const auto material = fit(model.name, set, options_with(components_of(model, "2", "1+1"), 12));
    ASSERT_TRUE(material) << material.error().what;
    const Direction light = info.lights[3];
    // A formula of the view says something about views that were not measured.
    if (!is_formula_of_view(model)) {
      EXPECT_EQ((*material)->radiance(2, Direction::UnitZ(), light),
                (*material)->radiance(2, Direction::UnitX(), light))
          << model.name;
    }
    EXPECT_GT((*material)->shader().gpu_bytes(), 0U);
  }
}

TEST(Models, SavedMaterialsComeBackTheSame) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const fs::path path = folder.path() / "a.safetensors";
  for (const Model& model : models()) {
    for (const char* form : {"", "ratio", "subtractive"}) {
      FitOptions options = options_with(components_of(model, "2", "2+1"));
      options.form = form;
      const auto material = fit(model.name, set, options);
      ASSERT_EQ(material.has_value(), has_form(model, form)) << model.name << form;
      if (!material) continue;
      const Status saved = save_material(**material, path, {{"fitted_on", "a formula"}});
      ASSERT_TRUE(saved) << saved.error().what;
      const auto loaded = load_material(path);
      ASSERT_TRUE(loaded) << loaded.error().what;
      EXPECT_EQ((*loaded)->model(), model.name);
      EXPECT_EQ((*loaded)->width(), 5);
      EXPECT_EQ((*loaded)->height(), 3);
      const ModelShader a = (*material)->shader();
      const ModelShader b = (*loaded)->shader();
      EXPECT_EQ(a.source, b.source) << model.name;
      ASSERT_EQ(a.textures.size(), b.textures.size());
      for (std::size_t i = 0; i < a.textures.size(); ++i)
        EXPECT_TRUE(a.textures[i].data == b.textures[i].data) << a.textures[i].sampler;
      Pcg32 random(3);
      for (int i = 0; i < 200; ++i) {
        const Direction view = random_direction(random);
        const Direction light = random_direction(random);
        EXPECT_EQ((*material)->radiance(i % 12, view, light),
                  (*loaded)->radiance(i % 12, view, light));
      }
    }
  }
}

TEST(Models, TexturesHaveTheBytesTheirShapeAsksFor) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  for (const Model& model : models()) {
    for (const int clusters : {1, 3, 12}) {
      const auto material =
          fit(model.name, set, options_with(components_of(model, "5", "5+2"), clusters));
      ASSERT_TRUE(material) << material.error().what;
      for (const ModelTexture& texture : (*material)->shader().textures)
        EXPECT_EQ(texture.data.size(),
                  static_cast<std::size_t>(texture.width) * texture.height * texture.depth *
                      bytes_per_texel(texture.format))
            << model.name << " " << texture.sampler;
    }
  }
}

TEST(Models, FitsAreTheSameForTheSameSeed) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  for (const Model& model : models()) {
    const FitOptions options = options_with(components_of(model, "2", "1+1"), 3);
    const auto a = fit(model.name, set, options);
    const auto b = fit(model.name, set, options);
    ASSERT_TRUE(a && b);
    for (std::size_t i = 0; i < (*a)->contents().tensors.size(); ++i)
      EXPECT_TRUE(
          std::ranges::equal((*a)->contents().tensors[i].bytes, (*b)->contents().tensors[i].bytes))
          << model.name << " " << (*a)->contents().tensors[i].spec.name;
  }
}

}  // namespace
}  // namespace veneer::btf
