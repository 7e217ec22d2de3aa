// SPDX-License-Identifier: Apache-2.0
#include "tests/stability/subjects.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/testing/fp_trap.h"

namespace veneer::stability {
namespace {

using btf::Direction;
using btf::DirectionSet;

// Weights, functions and colours in float16 are off by 2^-11 each.
constexpr double kHalf = 4.0 * 0x1p-11;
// Steps of 1/127 and of 1/255, of a function's largest value.
constexpr double kByte = 1.0 / 127.0;
// Formulas and grids are continuous: what 1e-7 radians make of them, measured 2.6e-7.
constexpr double kSmooth = 2e-6;
// A stack of layers has steps, where a ray goes over to the next texel, as high as these differ.
// They lie on curves of directions that none of the families' seams is on with these heights, in
// texels; between them it is a formula. Flat sets lie in the lowest of them.
constexpr btf::HeightRange kLayersAt{0.0, 0.71};
// Cells of a table keep one triangle each, so that there is a step where the next cell has another;
// measured 5.6e-6.
constexpr double kTable = 5e-5;

btf::FitOptions options_of(const std::string& components) {
  btf::FitOptions options;
  options.components = components;
  options.clusters = 3;
  options.angular = 8;
  return options;
}
btf::FitOptions with_precision(const char* precision) {
  btf::FitOptions options = options_of("4");
  options.precision = precision;
  return options;
}
btf::FitOptions dichromatic(const char* form, const char* specular, const char* clustering) {
  btf::FitOptions options = options_of("3+2");
  options.form = form;
  options.specular = specular;
  options.clustering = clustering;
  return options;
}
btf::FitOptions with_layers(int layers, const btf::HeightRange& heights) {
  btf::FitOptions options = options_of("4");
  options.layers = layers;
  options.heights = heights;
  return options;
}
btf::FitOptions with_mip_levels() {
  btf::FitOptions options = options_of("3+1");
  options.mip_levels = 2;
  return options;
}

}  // namespace

void PrintTo(const Subject& subject, std::ostream* out) { *out << subject.name; }

std::span<const Subject> subjects() {
  static const std::vector<Subject> kSubjects{
      {"Phong", "phong", options_of("4"), false, kHalf, kSmooth},
      {"Lafortune", "lafortune", options_of("4"), false, kHalf, kSmooth},
      {"ScaledLafortune", "scaled-lafortune", options_of("4"), false, kHalf, kTable},
      {"ReflectanceField", "reflectance-field", options_of("4"), false, kHalf, kTable},
      {"LayeredFlat", "layered", with_layers(1, {0.0, 0.0}), false, kHalf, kSmooth},
      {"LayeredStack", "layered", with_layers(3, kLayersAt), false, kHalf, kSmooth},
      {"EigenTexture8Bit", "eigen-texture", with_precision("8bit"), true, kByte, kTable},
      {"EigenTextureFloat16", "eigen-texture", with_precision("float16"), true, kHalf, kTable},
      {"Lpca", "lpca", options_of("4"), true, kHalf, kTable},
      {"RevisedLpca8Bit", "revised-lpca", with_precision("8bit"), true, kByte, kSmooth},
      {"RevisedLpcaFloat16", "revised-lpca", with_precision("float16"), true, kHalf, kSmooth},
      {"DichromaticLearned", "dichromatic-lpca", dichromatic("", "", ""), true, kHalf, kSmooth},
      {"DichromaticRatio", "dichromatic-lpca", dichromatic("ratio", "", ""), true, kHalf, kSmooth},
      {"DichromaticSubtractive",
       "dichromatic-lpca",
       dichromatic("subtractive", "", ""),
       true,
       kHalf,
       kSmooth},
      {"DichromaticHalfAngle",
       "dichromatic-lpca",
       dichromatic("", "half-angle", ""),
       true,
       kHalf,
       kSmooth},
      {"DichromaticSeparate",
       "dichromatic-lpca",
       dichromatic("", "", "separate"),
       true,
       kHalf,
       kSmooth},
      {"TexelColours", "texel-colours", options_of("3+1"), true, kHalf, kSmooth},
      {"TexelColoursMipped", "texel-colours", with_mip_levels(), true, kHalf, kSmooth},
  };
  return kSubjects;
}

std::vector<Query> cross(const DirectionSet& views, const DirectionSet& lights, int texels) {
  std::vector<Query> queries;
  for (const Direction& view : views)
    for (const Direction& light : lights)
      queries.push_back({static_cast<int>(queries.size()) % texels, view, light});
  return queries;
}

DirectionSet awkward_directions() {
  constexpr double kPi = std::numbers::pi;
  DirectionSet all{
      Direction::UnitZ(), -Direction::UnitZ(), Direction::UnitX(), -Direction::UnitY()};
  for (const btf::Angles& angles : {btf::Angles{1e-7, 0.3},
                                    {1e-3, 4.0},
                                    {0.6, 0.0},
                                    {0.6, kPi / 4},
                                    {0.9, kPi},
                                    {1.1, 7 * kPi / 4},
                                    {75 * kPi / 180, 2 * kPi - 1e-4},
                                    {1.45, 2.2},
                                    {kPi / 2 - 1e-3, 1.0},
                                    {kPi / 2 - 1e-6, 5.0},
                                    {kPi / 2 + 1e-3, 3.0},
                                    {2.0, 0.8}})
    all.push_back(btf::direction_from_angles(angles));
  return all;
}

std::vector<Eigen::Vector3d> evaluate(const btf::Material& material,
                                      std::span<const Query> queries) {
  const FpTrap trap;
  std::vector<Eigen::Vector3d> values;
  for (const Query& query : queries)
    values.push_back(material.radiance(query.texel, query.view, query.light));
  return values;
}

DirectionSet measured_directions() {
  constexpr double kDegree = std::numbers::pi / 180.0;
  DirectionSet all = btf::testing::ring(6, 35 * kDegree);
  const DirectionSet outer = btf::testing::ring(10, 75 * kDegree);
  all.insert(all.end(), outer.begin() + 1, outer.end());
  return all;
}

btf::SampleSetInfo usual_info() {
  btf::SampleSetInfo info;
  info.width = 4;
  info.height = 3;
  info.polarised = true;
  info.views = info.lights = measured_directions();
  info.source = "a formula";
  return info;
}

double colour(int texel, int channel) { return 0.2 + 0.1 * ((3 * texel + 5 * channel) % 8); }

double lambert(const btf::SampleSetInfo& info, int texel, int light, int channel) {
  return colour(texel, channel) * std::max(info.lights[static_cast<std::size_t>(light)].z(), 0.0);
}

btf::SampleSet glossy_set(const std::filesystem::path& folder, const DirectionSet& directions) {
  btf::SampleSetInfo info = usual_info();
  info.views = info.lights = directions;
  return btf::testing::make_set(
      folder, info, [&](int texel, int view, int light, int channel) -> float {
        if (channel >= 3) return static_cast<float>(lambert(info, texel, light, channel - 3));
        const Direction& l = info.lights[static_cast<std::size_t>(light)];
        const double base =
            Direction(-l.x(), -l.y(), l.z()).dot(info.views[static_cast<std::size_t>(view)]);
        return static_cast<float>(0.3 * (1 + texel % 3) / 3.0 * std::pow(std::max(base, 0.0), 8.0) *
                                  l.z());
      });
}

Result<std::unique_ptr<btf::Material>> fit(const Subject& subject, const btf::SampleSet& set) {
  const FpTrap trap;
  SilentProgress progress;
  const auto model = btf::find_model(subject.model);
  if (!model) return tl::unexpected<Error>(model.error());
  return (*model)->fit(set, subject.options, progress);
}

TEST(Subjects, AreAllModels) {
  for (const btf::Model& model : btf::models())
    EXPECT_TRUE(std::ranges::any_of(subjects(), [&](const Subject& subject) {
      return model.name == subject.model;
    })) << model.name;
}

}  // namespace veneer::stability
