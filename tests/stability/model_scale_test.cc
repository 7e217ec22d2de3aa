// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "base/testing/temporary_folder.h"
#include "tests/stability/gl_probe.h"
#include "tests/stability/subjects.h"

// A set's scale, and what comes of it for every model.
namespace veneer::stability {
namespace {

class ModelOfScaledSet : public ::testing::TestWithParam<std::tuple<Subject, int>> {};

// To the last bit: in double, in float, from a file and on the GPU, whose float holds 2^-20 to 2^20
// times any sample.
TEST_P(ModelOfScaledSet, IsTheModelTimesTheScale) {
  const auto& [subject, exponent] = GetParam();
  const double scale = std::ldexp(1.0, exponent);
  const TemporaryFolder folder;
  const btf::SampleSet one = glossy_set(folder.path() / "a.btfset");
  const auto plain = fit(subject, one);
  const auto scaled = fit(subject, one.with_scale(scale));
  ASSERT_TRUE(plain) << plain.error().what;
  ASSERT_TRUE(scaled) << scaled.error().what;
  const std::filesystem::path path = folder.path() / "a.safetensors";
  ASSERT_TRUE(btf::save_material(**scaled, path, {}));
  const auto loaded = btf::load_material(path);
  ASSERT_TRUE(loaded) << loaded.error().what;

  const btf::DirectionSet directions = awkward_directions();
  const std::vector<Query> queries = cross(directions, directions, 12);
  const auto wanted = evaluate(**plain, queries);
  for (const btf::Material* material : {scaled->get(), loaded->get()}) {
    const auto got = evaluate(*material, queries);
    for (std::size_t i = 0; i < got.size(); ++i) ASSERT_EQ(got[i], scale * wanted[i]) << i;
  }
  const auto before = GlProbe::create(**plain);
  if (!before && before.error().code == Errc::kUnavailable) GTEST_SKIP() << before.error().what;
  ASSERT_TRUE(before) << before.error().what;
  const auto after = GlProbe::create(**loaded);
  ASSERT_TRUE(after) << after.error().what;
  const auto drawn_before = before->draw(queries);
  const auto drawn = after->draw(queries);
  for (std::size_t i = 0; i < drawn.size(); ++i) ASSERT_EQ(drawn[i], scale * drawn_before[i]) << i;
}

INSTANTIATE_TEST_SUITE_P(Stability,
                         ModelOfScaledSet,
                         ::testing::Combine(::testing::ValuesIn(subjects().begin(),
                                                                subjects().end()),
                                            ::testing::Values(-20, 20)),
                         [](const ::testing::TestParamInfo<std::tuple<Subject, int>>& test) {
                           const int exponent = std::get<int>(test.param);
                           return fmt::format("{}_TwoToThe{}{}",
                                              std::get<Subject>(test.param).name,
                                              exponent < 0 ? "Minus" : "",
                                              std::abs(exponent));
                         });

// Every power between them, without GL.
class ModelOfAnyScale : public ::testing::TestWithParam<Subject> {};

TEST_P(ModelOfAnyScale, IsTheModelTimesTheScale) {
  const TemporaryFolder folder;
  const btf::SampleSet one = glossy_set(folder.path() / "a.btfset");
  const auto plain = fit(GetParam(), one);
  ASSERT_TRUE(plain) << plain.error().what;
  const btf::DirectionSet directions = awkward_directions();
  const std::vector<Query> queries = cross(directions, directions, 12);
  const auto wanted = evaluate(**plain, queries);
  const btf::Material& material = **plain;
  for (int exponent = -20; exponent <= 20; exponent += 5) {
    const double scale = std::ldexp(1.0, exponent);
    const auto scaled = fit(GetParam(), one.with_scale(scale));
    ASSERT_TRUE(scaled) << scaled.error().what;
    const auto got = evaluate(**scaled, queries);
    std::vector<float> rgb(static_cast<std::size_t>(one.info().pair_count()) * 3);
    std::vector<float> scaled_rgb(rgb.size());
    material.reconstruct(7, rgb);
    (*scaled)->reconstruct(7, scaled_rgb);
    for (std::size_t i = 0; i < got.size(); ++i) ASSERT_EQ(got[i], scale * wanted[i]) << exponent;
    for (std::size_t i = 0; i < rgb.size(); ++i)
      ASSERT_EQ(scaled_rgb[i], std::ldexp(rgb[i], exponent));
  }
}

INSTANTIATE_TEST_SUITE_P(Stability,
                         ModelOfAnyScale,
                         ::testing::ValuesIn(subjects().begin(), subjects().end()),
                         [](const ::testing::TestParamInfo<Subject>& test) {
                           return std::string(test.param.name);
                         });

}  // namespace
}  // namespace veneer::stability
