// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "btf/internal_thread_ranks.h"
#include "btf/models/internal_test_models.h"

// The specular term over the half angle, and terms with clusters of their own; what holds for all
// forms is in models_test.cc.
namespace veneer::btf {
namespace {

using testing::dichromatic_set;
using testing::fit;
using testing::kHalfTolerance;
using testing::largest_error;
using testing::make_set;
using testing::options_with;
using testing::random_direction;

constexpr std::string_view kModel = "dichromatic-lpca";

FitOptions options_of(std::string specular) {
  FitOptions options = options_with("1+1");
  options.specular = std::move(specular);
  return options;
}

std::string kept(const Material& material) { return material.contents().metadata.at("specular"); }

SampleSetInfo bonn_info() {
  SampleSetInfo info = testing::small_info(true);
  info.views = info.lights = bonn_directions();
  return info;
}

// A lobe about the mirror direction, stretched along x where `grain` is above 1.
SampleSet glossy_set(const std::filesystem::path& folder, double grain) {
  const SampleSetInfo info = bonn_info();
  return make_set(folder, info, [info, grain](int texel, int view, int light, int channel) {
    const Direction& l = info.lights[static_cast<std::size_t>(light)];
    const Direction half = (info.views[static_cast<std::size_t>(view)] + l).normalized();
    const double x = half.x() / half.z() / grain;
    const double y = half.y() / half.z() * grain;
    const double lobe = std::exp(-8.0 * (x * x + y * y));
    return static_cast<float>(l.z() * (channel < 3 ? 0.1 * (1 + texel % 4) * lobe : 0.3));
  });
}

class HalfAngleSpecular : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleSet isotropic_ = glossy_set(folder_.path() / "isotropic.btfset", 1.0);
  SampleSet grained_ = glossy_set(folder_.path() / "grained.btfset", 2.0);
};

TEST_F(HalfAngleSpecular, IsReciprocalAndIsotropicBesideTheCosine) {
  // Even of data that are not.
  const auto material = fit(kModel, grained_, options_of("half-angle"));
  ASSERT_TRUE(material) << material.error().what;
  ASSERT_EQ(kept(**material), "half-angle");
  Pcg32 random(3);
  const auto gloss = [&](const Direction& view, const Direction& light) -> Eigen::Vector3d {
    return ((**material).radiance(2, view, light) - (**material).diffuse_radiance(2, view, light)) /
           light.z();
  };
  double brightest = 0;
  for (int i = 0; i < 500; ++i) {
    const Direction view = random_direction(random, 0.1);
    const Direction light = random_direction(random, 0.1);
    const Eigen::AngleAxisd turn(6 * random.uniform(), Direction::UnitZ());
    const Eigen::Vector3d here = gloss(view, light);
    EXPECT_LT((here - gloss(light, view)).norm(), 1e-9);
    EXPECT_LT((here - gloss(turn * view, turn * light)).norm(), 1e-9);
    brightest = std::max(brightest, here.maxCoeff());
  }
  EXPECT_GT(brightest, 0.05);
}

TEST_F(HalfAngleSpecular, IsExactForMaterialsOfTheHalfAngle) {
  const auto material = fit(kModel, isotropic_, options_of("half-angle"));
  ASSERT_TRUE(material) << material.error().what;
  // The lobe is 0.4 high; its nodes are a thirteenth of its width apart.
  EXPECT_LT(largest_error(isotropic_, **material), 4e-3);
  // As drawn too: measured directions need no interpolation but the grid's.
  const SampleSetInfo& info = isotropic_.info();
  std::vector<float> rgb(static_cast<std::size_t>(info.pair_count()) * 3);
  std::vector<float> factors(rgb.size());
  isotropic_.rgb(6, Part::kTotal, rgb);
  (*material)->reconstruct(6, factors);
  std::size_t i = 0;
  for (const Direction& view : info.views)
    for (const Direction& light : info.lights) {
      const double body = (*material)->diffuse_radiance(6, view, light)[0];
      const double drawn = (*material)->radiance(6, view, light)[0] - body;
      EXPECT_NEAR(drawn, double(rgb[i]) - 0.3 * light.z(), 5e-3);
      i += 3;
    }
}

// Fitted to what such a material shows, it is that material again.
TEST_F(HalfAngleSpecular, RecoversWhatItMadeItself) {
  const auto first = fit(kModel, grained_, options_of("half-angle"));
  ASSERT_TRUE(first) << first.error().what;
  const SampleSetInfo info = bonn_info();
  std::vector<std::vector<float>> shown;
  for (int texel = 0; texel < info.texel_count(); ++texel)
    (*first)->reconstruct(texel,
                          shown.emplace_back(static_cast<std::size_t>(info.pair_count()) * 3));
  const SampleSet made = make_set(
      folder_.path() / "made.btfset", info, [&](int texel, int view, int light, int channel) {
        const auto pair =
            static_cast<std::size_t>(view) * info.lights.size() + static_cast<std::size_t>(light);
        const float body =
            0.3F * static_cast<float>(info.lights[static_cast<std::size_t>(light)].z());
        return channel < 3 ? shown[static_cast<std::size_t>(texel)]
                                  [3 * pair + static_cast<std::size_t>(channel)] -
                                 body
                           : body;
      });
  const auto second = fit(kModel, made, options_of("half-angle"));
  ASSERT_TRUE(second) << second.error().what;
  // A pair that alone tells a node, and hardly, is drawn to its neighbours each time: few are.
  double squares = 0;
  double energy = 0;
  std::vector<float> again(static_cast<std::size_t>(info.pair_count()) * 3);
  for (int texel = 0; texel < info.texel_count(); ++texel) {
    const std::vector<float>& wanted = shown[static_cast<std::size_t>(texel)];
    (*second)->reconstruct(texel, again);
    for (std::size_t i = 0; i < again.size(); ++i) {
      squares += std::pow(double(again[i] - wanted[i]), 2);
      energy += std::pow(double(wanted[i]), 2);
    }
  }
  EXPECT_LT(std::sqrt(squares / energy), kHalfTolerance);
}

TEST_F(HalfAngleSpecular, MeasuringKeepsItWhereTheMaterialAllowsIt) {
  const auto round = fit(kModel, isotropic_, options_of("measured"));
  const auto grained = fit(kModel, grained_, options_of("measured"));
  ASSERT_TRUE(round && grained);
  EXPECT_EQ(kept(**round), "half-angle");
  EXPECT_EQ(kept(**grained), "product");
  // What it does not keep leaves no trace.
  const auto product = fit(kModel, grained_, options_of(""));
  ASSERT_TRUE(product);
  EXPECT_EQ(kept(**product), "product");
  for (const auto& [a, b] : {std::pair{&*grained, &*product}})
    EXPECT_EQ((*a)->radiance(3, Direction(0.6, 0, 0.8), Direction(0, 0.6, 0.8)),
              (*b)->radiance(3, Direction(0.6, 0, 0.8), Direction(0, 0.6, 0.8)));
}

TEST_F(HalfAngleSpecular, TakesOneFetchForFourComponents) {
  FitOptions options = options_of("half-angle");
  options.components = "4+4";
  options.clusters = 1;
  options.angular = 8;
  const auto half = fit(kModel, isotropic_, options);
  options.specular = "product";
  const auto product = fit(kModel, isotropic_, options);
  ASSERT_TRUE(half && product);
  EXPECT_EQ((*half)->shader().fetches, (*product)->shader().fetches - 1);
  EXPECT_LT((*half)->shader().gpu_bytes(), (*product)->shader().gpu_bytes());
}

TEST_F(HalfAngleSpecular, IsTheSameAfterSavingAndLoading) {
  const auto material = fit(kModel, isotropic_, options_of("half-angle"));
  ASSERT_TRUE(material);
  const auto path = folder_.path() / "m.safetensors";
  ASSERT_TRUE(save_material(**material, path, {}));
  const auto loaded = load_material(path);
  ASSERT_TRUE(loaded) << loaded.error().what;
  EXPECT_EQ(kept(**loaded), "half-angle");
  Pcg32 random(5);
  for (int i = 0; i < 100; ++i) {
    const Direction view = random_direction(random, -0.2);
    const Direction light = random_direction(random, -0.2);
    EXPECT_EQ((*material)->radiance(1, view, light), (*loaded)->radiance(1, view, light));
  }
}

TEST_F(HalfAngleSpecular, RanksShareIt) {
  const auto alone = fit(kModel, isotropic_, options_of("measured"));
  ASSERT_TRUE(alone);
  run_on_ranks(2, [&](Communicator& ranks) {
    FitOptions options = options_of("measured");
    options.ranks = &ranks;
    const auto shared = fit(kModel, isotropic_, options);
    ASSERT_TRUE(shared);
    EXPECT_EQ(kept(**shared), "half-angle");
    for (int texel = 0; texel < 15; ++texel)
      EXPECT_LT(((*shared)->radiance(texel, {0.6, 0, 0.8}, {0, 0.6, 0.8}) -
                 (*alone)->radiance(texel, {0.6, 0, 0.8}, {0, 0.6, 0.8}))
                    .norm(),
                kHalfTolerance);
  });
}

TEST_F(HalfAngleSpecular, BlackGlossAndSingleDirectionsFit) {
  SampleSetInfo info = testing::small_info(true);
  for (const bool one_view : {false, true}) {
    info.views = one_view ? DirectionSet{Direction::UnitZ()} : testing::ring(6, 1.0);
    info.lights = one_view ? testing::ring(7, 1.1) : DirectionSet{Direction::UnitZ()};
    for (const float gloss : {0.0F, 0.5F}) {
      const auto name = fmt::format("{}{}.btfset", one_view, gloss);
      const SampleSet set = make_set(folder_.path() / name, info, [&](int, int, int, int channel) {
        return channel < 3 ? gloss : 0.25F;
      });
      const auto material = fit(kModel, set, options_of("half-angle"));
      ASSERT_TRUE(material) << material.error().what;
      EXPECT_LT(largest_error(set, **material), 2 * kHalfTolerance);
      EXPECT_TRUE((*material)->radiance(0, {0, 0, 1}, {0.6, 0, 0.8}).allFinite());
    }
  }
}

TEST_F(HalfAngleSpecular, WhatCannotBeIsRefused) {
  FitOptions options = options_of("quarter-angle");
  EXPECT_EQ(fit(kModel, isotropic_, options).error().code, Errc::kInvalidOption);
  options = options_of("half-angle");
  options.form = "subtractive";
  EXPECT_EQ(fit(kModel, isotropic_, options).error().code, Errc::kInvalidOption);
  options.specular = "measured";
  const auto measured = fit(kModel, isotropic_, options);
  ASSERT_TRUE(measured) << measured.error().what;
  EXPECT_EQ(kept(**measured), "product");
  for (const Model& model : models()) {
    if (model.name == kModel) continue;
    const auto refused = fit(model.name, isotropic_, options_of("half-angle"));
    ASSERT_FALSE(refused) << model.name;
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  }
}

// Shading and gloss of two kinds each, in all four pairings: two clusters tell both kinds of each
// term only where the terms have clusters of their own.
SampleSet crossed_set(const std::filesystem::path& folder, bool crossed) {
  SampleSetInfo info = testing::small_info(true);
  info.width = info.height = 4;
  return make_set(folder, info, [info, crossed](int texel, int view, int light, int channel) {
    const int kind = texel % 2;
    const bool other = crossed ? texel / 2 % 2 == 0 : kind == 0;
    const Direction& l = info.lights[static_cast<std::size_t>(light)];
    const Direction& v = info.views[static_cast<std::size_t>(view)];
    if (channel >= 3)
      return static_cast<float>(0.5 * l.z() * (kind == 0 ? 1.0 : 1.0 - 0.8 * v.z()));
    const Direction half = (v + l).normalized();
    return static_cast<float>(0.4 * l.z() * std::pow(half.z(), other ? 4.0 : 40.0));
  });
}

class SeparateClusters : public ::testing::Test {
 protected:
  [[nodiscard]] static FitOptions options_of(std::string clustering, std::string specular = "") {
    FitOptions options = options_with("1+1", 2);
    options.clustering = std::move(clustering);
    options.specular = std::move(specular);
    return options;
  }
  static std::string kept(const Material& m) { return m.contents().metadata.at("clustering"); }
  TemporaryFolder folder_;
  SampleSet crossed_ = crossed_set(folder_.path() / "crossed.btfset", true);
  SampleSet together_ = crossed_set(folder_.path() / "together.btfset", false);
};

TEST_F(SeparateClusters, TellApartWhatJointOnesMix) {
  const auto separate = fit(kModel, crossed_, options_of("separate"));
  const auto joint = fit(kModel, crossed_, options_of("joint"));
  ASSERT_TRUE(separate && joint);
  EXPECT_LT(largest_error(crossed_, **separate), kHalfTolerance);
  EXPECT_GT(largest_error(crossed_, **joint), 10 * kHalfTolerance);
  EXPECT_EQ((*separate)->values_per_texel(), (*joint)->values_per_texel() + 1);
  EXPECT_GT((*separate)->shader().fetches, (*joint)->shader().fetches);
  // With the half angle there is no fetch more: the terms are fetched apart in any case.
  const auto half = fit(kModel, crossed_, options_of("joint", "half-angle"));
  const auto both = fit(kModel, crossed_, options_of("separate", "half-angle"));
  ASSERT_TRUE(half && both);
  EXPECT_EQ((*both)->shader().fetches, (*half)->shader().fetches);
  EXPECT_LT(largest_error(crossed_, **both), 4 * kHalfTolerance);  // and the grid of half angles
}

TEST_F(SeparateClusters, MeasuringKeepsThemWhereTheyGain) {
  const auto crossed = fit(kModel, crossed_, options_of("measured"));
  const auto together = fit(kModel, together_, options_of("measured"));
  ASSERT_TRUE(crossed && together);
  EXPECT_EQ(kept(**crossed), "separate");
  EXPECT_EQ(kept(**together), "joint");
}

TEST_F(SeparateClusters, AreTheSameAfterSavingAndLoading) {
  Pcg32 random(5);
  for (const char* specular : {"product", "half-angle"}) {
    const auto material = fit(kModel, crossed_, options_of("separate", specular));
    ASSERT_TRUE(material);
    const auto path = folder_.path() / "m.safetensors";
    ASSERT_TRUE(save_material(**material, path, {}));
    const auto loaded = load_material(path);
    ASSERT_TRUE(loaded) << loaded.error().what;
    EXPECT_EQ(kept(**loaded), "separate");
    for (int i = 0; i < 50; ++i) {
      const Direction view = random_direction(random, -0.2);
      const Direction light = random_direction(random, -0.2);
      EXPECT_EQ((*material)->radiance(i % 16, view, light),
                (*loaded)->radiance(i % 16, view, light));
    }
  }
}

TEST_F(SeparateClusters, OtherWordsAndOtherModelsAreRefused) {
  EXPECT_EQ(fit(kModel, crossed_, options_of("apart")).error().code, Errc::kInvalidOption);
  for (const Model& model : models()) {
    if (model.name == kModel) continue;
    const auto refused = fit(model.name, crossed_, options_of("separate"));
    ASSERT_FALSE(refused) << model.name;
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  }
}

// One texel, and more clusters than texels.
TEST_F(SeparateClusters, FitASingleTexel) {
  SampleSetInfo info = testing::small_info(true);
  info.width = info.height = 1;
  const SampleSet one =
      make_set(folder_.path() / "one.btfset", info, [](int, int, int, int channel) {
        return channel < 3 ? 0.1F : 0.3F;
      });
  const auto material = fit(kModel, one, options_of("separate"));
  ASSERT_TRUE(material) << material.error().what;
  EXPECT_LT(largest_error(one, **material), kHalfTolerance);
}

// With 0 components of it nothing is kept of the specular term: what is drawn is what the same fit
// draws without it, in clusters of the diffuse part alone.
TEST(DichromaticLpca, LeavesOutItsSpecularTermWhereAsked) {
  const TemporaryFolder folder;
  const SampleSet set = dichromatic_set(folder.path() / "set.btfset", true);
  const auto both = fit(kModel, set, options_with("1+1"));
  const auto diffuse = fit(kModel, set, options_with("1+0"));
  ASSERT_TRUE(both) << both.error().what;
  ASSERT_TRUE(diffuse) << diffuse.error().what;
  const Material* with = both->get();
  const Material* without = diffuse->get();
  EXPECT_TRUE(with->has_specular_term());
  EXPECT_FALSE(without->has_specular_term());
  EXPECT_LT(without->values_per_texel(), with->values_per_texel());
  const std::filesystem::path file = folder.path() / "material.safetensors";
  ASSERT_TRUE(save_material(*without, file, {}));
  const auto loaded = load_material(file);
  ASSERT_TRUE(loaded) << loaded.error().what;
  Pcg32 random(7);
  for (int i = 0; i < 200; ++i) {
    const int texel = i % set.info().texel_count();
    const Direction view = random_direction(random);
    const Direction light = random_direction(random);
    const Eigen::Vector3d drawn = without->radiance(texel, view, light);
    EXPECT_LT((drawn - with->diffuse_radiance(texel, view, light)).norm(), kHalfTolerance);
    EXPECT_EQ(drawn, without->diffuse_radiance(texel, view, light));
    EXPECT_EQ(drawn, (*loaded)->radiance(texel, view, light));
  }
}

}  // namespace
}  // namespace veneer::btf
