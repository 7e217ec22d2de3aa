// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "btf/internal_test_sets.h"
#include "btf/material.h"

// Laws of the models whose texels have lobes.
namespace veneer::btf {
namespace {

namespace fs = std::filesystem;
using testing::make_set;
using testing::random_direction;

constexpr std::array kLobeModels{"lafortune", "phong", "reflectance-field", "scaled-lafortune"};

// The largest error, relative to the brightest sample, with which a model fits what it made itself:
// coefficients in float16 times exponents of some tens.
constexpr double kRecovered = 0.03;
// And in the mean.
constexpr double kRecoveredMean = 2e-3;

SampleSetInfo info_of(int texels) {
  SampleSetInfo info;
  info.width = texels;
  info.height = 1;
  info.views = bonn_directions();
  std::erase_if(info.views, [](const Direction& d) { return d.z() < 0.6; });
  info.lights = info.views;
  info.source = "a formula";
  return info;
}

// Lambert and a glossy lobe, some texels shadowed from one side.
SampleSet glossy_set(const fs::path& folder, const SampleSetInfo& info) {
  return make_set(folder, info, [&](int texel, int view, int light, int channel) {
    const Direction& v = info.views[static_cast<std::size_t>(view)];
    const Direction& l = info.lights[static_cast<std::size_t>(light)];
    const Direction half = (v + l).normalized();
    const double shadow = texel % 2 == 0 ? 1.0 : 0.6 + 0.4 * v.x();
    return static_cast<float>(
        l.z() * shadow *
        (0.1 * (1 + texel % 3) + 0.1 * channel + 0.5 * std::pow(half.z(), 10.0 + 5.0 * texel)));
  });
}

std::unique_ptr<Material> fit(std::string_view model, const SampleSet& set, int lobes = 2) {
  FitOptions options;
  options.lobes = lobes;
  SilentProgress progress;
  auto material = (*find_model(model))->fit(set, options, progress);
  if (!material) throw std::runtime_error(material.error().what);
  return std::move(*material);
}

struct Difference {
  double largest = 0.0;
  double mean = 0.0;
  double brightest = 0.0;
};
Difference difference(const SampleSet& set, const Material& material) {
  const auto values = static_cast<std::size_t>(set.info().pair_count()) * 3;
  std::vector<float> wanted(values);
  std::vector<float> got(values);
  Difference result;
  for (int texel = 0; texel < set.info().texel_count(); ++texel) {
    set.rgb(texel, Part::kTotal, wanted);
    material.reconstruct(texel, got);
    for (std::size_t i = 0; i < values; ++i) {
      const double d = std::abs(double(wanted[i]) - double(got[i]));
      result.largest = std::max(result.largest, d);
      result.mean += d / (double(values) * set.info().texel_count());
      result.brightest = std::max(result.brightest, double(wanted[i]));
    }
  }
  return result;
}

std::string metadata(const Material& material, const std::string& key) {
  return material.contents().metadata.at(key);
}

TEST(LobeModels, FitWhatTheyMadeThemselves) {
  const TemporaryFolder folder;
  const SampleSetInfo info = info_of(4);
  const SampleSet glossy = glossy_set(folder.path() / "glossy.btfset", info);
  for (const char* model : kLobeModels) {
    const auto first = fit(model, glossy);
    std::vector<std::vector<float>> made(4, std::vector<float>(3 * info.pair_count()));
    for (int texel = 0; texel < 4; ++texel)
      first->reconstruct(texel, made[static_cast<std::size_t>(texel)]);
    const auto path = folder.path() / (std::string(model) + ".btfset");
    const SampleSet own = make_set(path, info, [&](int texel, int view, int light, int channel) {
      const auto lights = static_cast<int>(info.lights.size());
      return made[static_cast<std::size_t>(texel)]
                 [static_cast<std::size_t>(3 * (view * lights + light) + channel)];
    });
    const Difference left = difference(own, *fit(model, own));
    EXPECT_LT(left.largest, kRecovered * left.brightest) << model;
    EXPECT_LT(left.mean, kRecoveredMean * left.brightest) << model;
  }
}

TEST(LobeModels, CountTheTexelsThatStayDiffuse) {
  const TemporaryFolder folder;
  const SampleSetInfo info = info_of(6);
  // Two black texels, one with a single bright pair, one lit for one view only.
  const SampleSet set =
      make_set(folder.path() / "a.btfset", info, [&](int texel, int view, int light, int channel) {
        if (texel == 1 || texel == 4) return 0.0F;
        if (texel == 2) return view == 9 && light == 3 ? 60000.0F : 0.0F;
        if (texel == 3) return view == 5 ? 1.0F : 0.0F;
        const Direction& l = info.lights[static_cast<std::size_t>(light)];
        return static_cast<float>((0.1 + 0.2 * channel) * l.z() + 0.5 * std::pow(l.z(), 9.0));
      });
  for (const char* model : kLobeModels) {
    const auto material = fit(model, set);
    const int fallbacks = std::stoi(metadata(*material, "fallback_texels"));
    EXPECT_GE(fallbacks, 2) << model;
    EXPECT_LE(fallbacks, 4) << model;
    std::vector<float> rgb(3 * static_cast<std::size_t>(info.pair_count()));
    for (const int black : {1, 4}) {
      material->reconstruct(black, rgb);
      EXPECT_EQ(std::ranges::max(rgb), 0.0F) << model;
    }
    Pcg32 random(4);
    for (int i = 0; i < 3000; ++i) {
      const Eigen::Vector3d drawn =
          material->radiance(i % 6, random_direction(random, -0.1), random_direction(random, -0.1));
      EXPECT_TRUE(drawn.allFinite() && drawn.minCoeff() >= 0.0) << model << drawn.transpose();
    }
  }
}

TEST(LobeModels, FitATexelWhateverTheOthers) {
  // So no thread, order or piece of work makes a difference.
  const TemporaryFolder folder;
  const SampleSetInfo info = info_of(20);
  const SampleSet all = glossy_set(folder.path() / "all.btfset", info);
  SampleSetInfo of_one = info;
  of_one.width = 1;
  constexpr int kTexel = 13;
  const SampleSet one =
      make_set(folder.path() / "one.btfset", of_one, [&](int, int v, int l, int c) {
        const auto pair =
            static_cast<std::size_t>(v) * info.lights.size() + static_cast<std::size_t>(l);
        return static_cast<float>(all.stored(kTexel)[3 * pair + static_cast<std::size_t>(c)]);
      });
  for (const char* model : kLobeModels) {
    const auto among = fit(model, all, 1);
    const auto alone = fit(model, one, 1);
    Pcg32 random(8);
    for (int i = 0; i < 100; ++i) {
      const Direction view = random_direction(random);
      const Direction light = random_direction(random);
      EXPECT_EQ(among->radiance(kTexel, view, light), alone->radiance(0, view, light)) << model;
    }
  }
}

TEST(LobeModels, FitOneViewAndOneLight) {
  const TemporaryFolder folder;
  for (const bool one_view : {true, false}) {
    SampleSetInfo info = info_of(2);
    (one_view ? info.views : info.lights) = {direction_from_angles({0.5, 1.0})};
    const SampleSet set =
        glossy_set(folder.path() / (one_view ? "view.btfset" : "light.btfset"), info);
    for (const char* model : kLobeModels) {
      const auto material = fit(model, set);
      const Difference left = difference(set, *material);
      EXPECT_LT(left.mean, 0.1 * left.brightest) << model << one_view;
    }
  }
}

TEST(LobeModels, KeepTheNumbersOfTheLiterature) {
  // Meseth et al. 2003, Table 2, at 81 views and 2 lobes.
  const TemporaryFolder folder;
  SampleSetInfo info = info_of(1);
  info.views = bonn_directions();
  info.lights.resize(3);
  const SampleSet set = glossy_set(folder.path() / "a.btfset", info);
  EXPECT_EQ(fit("lafortune", set)->values_per_texel(), 14);
  EXPECT_EQ(fit("scaled-lafortune", set)->values_per_texel(), 257);
  EXPECT_EQ(fit("reflectance-field", set)->values_per_texel(), 894);
  EXPECT_EQ(fit("phong", set)->values_per_texel(), 5);
  EXPECT_EQ(fit("lafortune", set, 3)->values_per_texel(), 18);
}

TEST(LobeModels, MoreFreedomFitsBetter) {
  // Each of these can do what the one before it does. Reflectance fields have no lobes over views,
  // so that they are held to plain Lafortune lobes only.
  const TemporaryFolder folder;
  const SampleSet set = glossy_set(folder.path() / "a.btfset", info_of(6));
  const double phong = difference(set, *fit("phong", set)).mean;
  const double lafortune = difference(set, *fit("lafortune", set)).mean;
  const double scaled = difference(set, *fit("scaled-lafortune", set)).mean;
  EXPECT_LT(lafortune, phong);
  EXPECT_LT(scaled, lafortune);
  EXPECT_LT(difference(set, *fit("reflectance-field", set)).mean, lafortune);
}

}  // namespace
}  // namespace veneer::btf
