// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "btf/internal_test_sets.h"
#include "btf/interpolated_set.h"
#include "btf/material.h"

// Laws that hold for every model, and those of each.
namespace veneer::btf {
namespace {

namespace fs = std::filesystem;
using testing::make_set;
using testing::random_direction;

// Factors, weights and colours are float16: 2^-11 each, for values up to 1.
constexpr double kHalfTolerance = 4e-3;

DirectionSet ring(int count, double theta) {
  DirectionSet directions{Direction::UnitZ()};
  for (int i = 0; i < count; ++i)
    directions.push_back(direction_from_angles({theta, 2.0 * std::numbers::pi * i / count}));
  return directions;
}

SampleSetInfo small_info(bool polarised = false) {
  SampleSetInfo info;
  info.width = 5;  // an odd number of texels, which no tensor may be upset by
  info.height = 3;
  info.polarised = polarised;
  info.views = ring(6, 1.0);
  info.lights = ring(7, 1.1);
  info.source = "a formula";
  return info;
}

double cosine(const SampleSetInfo& info, int light) {
  return info.lights[static_cast<std::size_t>(light)].z();
}
double shine(const SampleSetInfo& info, int view, int light) {
  const Direction half =
      (info.views[static_cast<std::size_t>(view)] + info.lights[static_cast<std::size_t>(light)])
          .normalized();
  return std::pow(half.z(), 12.0) * cosine(info, light);
}

// Body colour times cosine plus light colour times a lobe: rank 1 in each term, two colours a
// texel. Polarised sets have the two parts in separate channels.
float dichromatic(const SampleSetInfo& info, int texel, int view, int light, int channel) {
  constexpr std::array kLightColour{0.9, 0.8, 0.6};
  const bool diffuse_part = channel >= 3;
  const int c = channel % 3;
  const double diffuse = (0.1 + 0.05 * texel * (c + 1) / 3.0) * cosine(info, light);
  const double specular = 0.3 * (1 + texel % 3) / 3.0 * kLightColour[static_cast<std::size_t>(c)] *
                          shine(info, view, light);
  if (!info.polarised) return static_cast<float>(diffuse + specular);
  return static_cast<float>(diffuse_part ? diffuse : specular);
}

SampleSet dichromatic_set(const fs::path& folder, bool polarised) {
  const SampleSetInfo info = small_info(polarised);
  return make_set(folder, info, [info](int texel, int view, int light, int channel) {
    return dichromatic(info, texel, view, light, channel);
  });
}

Result<std::unique_ptr<Material>> fit(std::string_view model,
                                      const SampleSet& set,
                                      const FitOptions& options) {
  SilentProgress progress;
  return (*find_model(model))->fit(set, options, progress);
}

FitOptions options_with(std::string components, int clusters = 2) {
  FitOptions options;
  options.components = std::move(components);
  options.clusters = clusters;
  options.angular = 12;
  return options;
}

// The one that a model of one term takes, or of two.
std::string components_of(const Model& model, const char* one, const char* two) {
  return model.terms == 2 ? two : one;
}

bool has_form(const Model& model, std::string_view form) {
  return form.empty() || model.name == "dichromatic-lpca";
}

bool is_formula_of_view(const Model& model) {
  return model.name == "lafortune" || model.name == "scaled-lafortune" || model.name == "phong";
}

double largest_error(const SampleSet& set, const Material& material) {
  std::vector<float> wanted(static_cast<std::size_t>(set.info().pair_count()) * 3);
  std::vector<float> got(wanted.size());
  double largest = 0.0;
  for (int texel = 0; texel < set.info().texel_count(); ++texel) {
    set.rgb(texel, Part::kTotal, wanted);
    material.reconstruct(texel, got);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      largest = std::max(largest, double(std::abs(wanted[i] - got[i])));
  }
  return largest;
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

TEST(LoadMaterial, RefusesDamagedFilesWithAMessage) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "a.btfset", true);
  const fs::path path = folder.path() / "a.safetensors";
  for (const Model& model : models()) {
    const auto material = fit(model.name, set, options_with(components_of(model, "2", "1+1")));
    ASSERT_TRUE(material) << material.error().what;
    const Material::Contents good = (*material)->contents();

    // Writes the contents after a change, under the given version.
    const auto load_changed = [&](const std::function<void(Material::Contents&)>& change) {
      Material::Contents contents = good;
      contents.metadata["format"] = "veneer-material";
      contents.metadata["version"] = "1";
      contents.metadata["model"] = model.name;
      change(contents);
      std::ranges::stable_sort(contents.tensors, std::greater{}, [](const auto& tensor) {
        return size_of(tensor.spec.dtype);
      });
      std::vector<TensorSpec> specs;
      for (const auto& tensor : contents.tensors) specs.push_back(tensor.spec);
      auto writer = SafetensorsWriter::create(path, specs, contents.metadata);
      EXPECT_TRUE(writer);
      for (const auto& tensor : contents.tensors) {
        const auto fill = [&]<class T>(std::span<T> target) {
          std::memcpy(target.data(),
                      tensor.bytes.data(),
                      std::min(target.size_bytes(), tensor.bytes.size()));
        };
        if (tensor.spec.dtype == DType::kU8) fill(writer->tensor<std::uint8_t>(tensor.spec.name));
        if (tensor.spec.dtype == DType::kF16) fill(writer->tensor<Eigen::half>(tensor.spec.name));
        if (tensor.spec.dtype == DType::kF32) fill(writer->tensor<float>(tensor.spec.name));
        if (tensor.spec.dtype == DType::kF64) fill(writer->tensor<double>(tensor.spec.name));
      }
      EXPECT_TRUE(writer->finish());
      return load_material(path);
    };
    const auto expect_refused = [&](const std::string& what,
                                    const std::function<void(Material::Contents&)>& change) {
      const auto loaded = load_changed(change);
      ASSERT_FALSE(loaded) << model.name << ": " << what;
      EXPECT_EQ(loaded.error().code, Errc::kBadFormat) << loaded.error().what;
      EXPECT_NE(loaded.error().what.find("a.safetensors"), std::string::npos)
          << loaded.error().what;
    };

    ASSERT_TRUE(load_changed([](auto&) {}));
    std::vector<std::string> keys{"format", "version", "model", "width"};
    for (const char* key : {"components", "lobes", "fallback_texels"})
      if (good.metadata.contains(key)) keys.emplace_back(key);
    for (const std::string& key : keys) {
      expect_refused(key, [key](auto& c) { c.metadata.erase(key); });
      expect_refused(key, [key](auto& c) { c.metadata[key] = "-7"; });
    }
    for (const char* name : {"views", "lights"}) {
      const auto tensor = std::ranges::find(
          good.tensors, name, [](const auto& t) -> const std::string& { return t.spec.name; });
      const auto index = static_cast<std::size_t>(tensor - good.tensors.begin());
      std::vector<double> values(tensor->bytes.size() / sizeof(double));
      std::memcpy(values.data(), tensor->bytes.data(), tensor->bytes.size());
      const auto replace_second = [&](const Direction& direction) {
        std::copy_n(direction.data(), 3, values.begin() + 3);
        return [&values, index](auto& c) {
          c.tensors[index].bytes = std::as_bytes(std::span(values));
        };
      };
      expect_refused("equal directions", replace_second({values[0], values[1], values[2]}));
      expect_refused("a direction from below", replace_second({0.6, 0.0, -0.8}));
    }
    if (good.metadata.contains("angular"))
      expect_refused("too many nodes", [](auto& c) { c.metadata["angular"] = "64"; });
    expect_refused("a newer version", [](auto& c) { c.metadata["version"] = "2"; });
    for (std::size_t i = 0; i < good.tensors.size(); ++i) {
      const TensorSpec& spec = good.tensors[i].spec;
      expect_refused("without " + spec.name, [i](auto& c) {
        c.tensors.erase(c.tensors.begin() + static_cast<std::ptrdiff_t>(i));
      });
      expect_refused("another shape of " + spec.name,
                     [i](auto& c) { c.tensors[i].spec.shape.back() *= 2; });
      // Any byte is a value of an image.
      if (spec.name == "eigen_textures" && spec.dtype == DType::kU8) continue;
      // All bits set: NaN, or a cluster that is not there.
      const std::vector<std::byte> bad(good.tensors[i].bytes.size(), std::byte{0xFF});
      expect_refused("bad values in " + spec.name, [&, i](auto& c) { c.tensors[i].bytes = bad; });
    }
  }
  EXPECT_EQ(load_material(folder.path() / "none.safetensors").error().code, Errc::kNotFound);

  ASSERT_TRUE(fit("lpca", set, options_with("2")).and_then([&](const auto& material) {
    return save_material(*material, path, {}).map([] { return 0; });
  }));
  fs::resize_file(path, fs::file_size(path) / 2);
  EXPECT_EQ(load_material(path).error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::btf
