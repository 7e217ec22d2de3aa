// SPDX-License-Identifier: Apache-2.0
#include "btf/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

// Single precision of values up to 1 and a few operations.
constexpr double kFloat = 1e-6;

SampleSetInfo small_info() {
  SampleSetInfo info;
  info.width = 5;
  info.height = 3;
  info.views = {Direction::UnitZ(), direction_from_angles({0.5, 1.0})};
  info.lights = {
      Direction::UnitZ(), direction_from_angles({0.7, 2.0}), direction_from_angles({1.5, 4.0})};
  return info;
}

float pattern(int texel, int view, int light, int channel) {
  return 0.25F + 0.03125F * static_cast<float>((texel + view + 2 * light + channel) % 9);
}

// A material that returns the pattern plus an error of the test's choice.
class FakeMaterial final : public Material {
 public:
  using ErrorFunction = std::function<float(int texel, int view, int light)>;
  FakeMaterial(SampleSetInfo info, ErrorFunction error)
      : info_(std::move(info)), error_(std::move(error)) {}
  std::string_view model() const override { return "fake"; }
  int width() const override { return info_.width; }
  int height() const override { return info_.height; }
  const DirectionSet& views() const override { return info_.views; }
  const DirectionSet& lights() const override { return info_.lights; }
  void reconstruct(int texel, std::span<float> rgb) const override {
    std::size_t i = 0;
    for (int view = 0; view < static_cast<int>(info_.views.size()); ++view)
      for (int light = 0; light < static_cast<int>(info_.lights.size()); ++light)
        for (int channel = 0; channel < 3; ++channel)
          rgb[i++] = pattern(texel, view, light, channel) + error_(texel, view, light);
  }
  Eigen::Vector3d radiance(int, const Direction&, const Direction&) const override {
    return Eigen::Vector3d::Zero();
  }
  double values_per_texel() const override { return 0.0; }
  ModelShader shader() const override {
    ModelShader shader;
    ModelTexture texture;
    texture.format = TexelFormat::kRgba16f;
    texture.width = info_.width;
    texture.height = info_.height;
    texture.data.resize(static_cast<std::size_t>(8 * info_.texel_count()));
    shader.textures.push_back(std::move(texture));
    shader.fetches = 7;
    return shader;
  }
  Contents contents() const override { return {}; }

 private:
  SampleSetInfo info_;
  ErrorFunction error_;
};

class Evaluate : public ::testing::Test {
 protected:
  Result<Evaluation> with(FakeMaterial::ErrorFunction error) {
    SilentProgress progress;
    return evaluate(set_, FakeMaterial(small_info(), std::move(error)), progress);
  }
  TemporaryFolder folder_;
  SampleSet set_ = testing::make_set(folder_.path() / "a.btfset", small_info(), pattern);
};

TEST_F(Evaluate, PerfectMaterialHasNoError) {
  const auto result = with([](int, int, int) { return 0.0F; });
  ASSERT_TRUE(result) << result.error().what;
  EXPECT_EQ(result->linear.epsilon_avg, 0.0);
  EXPECT_EQ(result->encoded.rmse, 0.0);
  EXPECT_EQ(result->psnr_db, std::numeric_limits<double>::infinity());
  EXPECT_NEAR(result->de00_p95, 0.0, kFloat);
  EXPECT_EQ(result->bytes_per_texel, 8.0);
  EXPECT_EQ(result->fetches, 7);
  // The fake draws black, so the error as drawn is the mean encoded sample.
  double mean = 0.0;
  for (int t = 0; t < 15; ++t)
    for (int v = 0; v < 2; ++v)
      for (int l = 0; l < 3; ++l)
        for (int c = 0; c < 3; ++c) mean += std::pow(pattern(t, v, l, c), 1.0 / 2.2) / (15 * 18);
  EXPECT_NEAR(result->drawn_epsilon_avg, mean, kFloat);
}

TEST_F(Evaluate, ConstantErrorIsItself) {
  const auto result = with([](int, int, int) { return -0.125F; });
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->linear.epsilon_avg, 0.125, kFloat);
  EXPECT_NEAR(result->linear.epsilon_min, 0.125, kFloat);
  EXPECT_NEAR(result->linear.epsilon_max, 0.125, kFloat);
  EXPECT_NEAR(result->linear.rmse, 0.125, kFloat);
  EXPECT_GT(result->encoded.epsilon_avg,
            0.125 / 2.2);  // the slope of x^(1/2.2) on (0, 1] is at least 1/2.2
  EXPECT_NEAR(result->psnr_db, -20.0 * std::log10(result->encoded.rmse), kFloat);
  EXPECT_GT(result->de00_mean, 5.0);
  EXPECT_GE(result->de00_p95, result->de00_mean);
}

TEST_F(Evaluate, ImagesAreOneViewAndLightEach) {
  // Only one of six images is wrong, by 0.1 in a third of its texels.
  const auto result =
      with([](int t, int v, int l) { return v == 1 && l == 2 && t % 3 == 0 ? 0.1F : 0.0F; });
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->linear.epsilon_max, 0.1 / 3.0, kFloat);
  EXPECT_EQ(result->linear.epsilon_min, 0.0);
  EXPECT_NEAR(result->linear.epsilon_avg, 0.1 / 18.0, kFloat);
  EXPECT_NEAR(result->linear.rmse, 0.1 / std::sqrt(18.0), kFloat);
}

TEST_F(Evaluate, TexelsHaveTheirOwnLeastAndLargestError) {
  // Texel 7 is off by 0.2 in one of six pairs, texel 2 by 0 everywhere, the others by 0.1.
  const auto result = with([](int t, int v, int l) {
    if (t == 2) return 0.0F;
    return t == 7 && v == 0 && l == 1 ? 0.2F : 0.1F;
  });
  ASSERT_TRUE(result);
  EXPECT_EQ(result->linear.texel_min, 0.0);
  EXPECT_NEAR(result->linear.texel_max, 0.7 / 6.0, kFloat);
  EXPECT_NEAR(result->linear.epsilon_avg, (13 * 0.1 + 0.7 / 6.0) / 15.0, kFloat);
  EXPECT_EQ(result->encoded.texel_min, 0.0);
  EXPECT_GT(result->encoded.texel_max, result->encoded.epsilon_avg);
}

TEST_F(Evaluate, BothSidesAreCutToTheUnitRange) {
  const auto above = with([](int, int, int) { return 100.0F; });
  ASSERT_TRUE(above);
  EXPECT_LT(above->linear.epsilon_max, 0.75 + kFloat);
  const auto below = with([](int, int, int) { return -100.0F; });
  ASSERT_TRUE(below);
  EXPECT_NEAR(below->encoded.epsilon_avg, below->drawn_epsilon_avg, kFloat);  // both are black
}

TEST_F(Evaluate, SaysWhereMaterialAndSetDoNotFit) {
  SilentProgress progress;
  const auto refused = [&](const std::function<void(SampleSetInfo&)>& change, const char* says) {
    SampleSetInfo info = small_info();
    change(info);
    const auto result =
        evaluate(set_, FakeMaterial(info, [](int, int, int) { return 0.0F; }), progress);
    ASSERT_FALSE(result) << says;
    EXPECT_EQ(result.error().code, Errc::kBadFormat);
    EXPECT_NE(result.error().what.find(says), std::string::npos) << result.error().what;
  };
  refused([](SampleSetInfo& i) { i.width = 4; }, "4 x 3 texels");
  refused([](SampleSetInfo& i) { i.views.back() = -i.views.back(); }, "other directions");
  refused([](SampleSetInfo& i) { i.lights[0] = Direction(0.6, 0, 0.8); }, "other directions");
}

TEST_F(Evaluate, AMaterialOfAPartOfTheDirectionsIsComparedThere) {
  SilentProgress progress;
  SampleSetInfo info = small_info();
  info.views.pop_back();
  info.lights.pop_back();
  const auto result = evaluate(
      set_, FakeMaterial(info, [](int, int, int l) { return l == 1 ? 0.1F : 0.0F; }), progress);
  ASSERT_TRUE(result) << result.error().what;
  EXPECT_NEAR(result->linear.epsilon_avg, 0.1 / 2.0, kFloat);
  EXPECT_NEAR(result->linear.epsilon_max, 0.1, kFloat);
}

TEST_F(Evaluate, NonFiniteValuesAreErrors) {
  const auto result =
      with([](int t, int, int) { return t == 4 ? std::numeric_limits<float>::quiet_NaN() : 0.0F; });
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().what.find("1 texels"), std::string::npos) << result.error().what;
  const SampleSet damaged =
      testing::make_set(folder_.path() / "b.btfset", small_info(), [](int t, int, int, int) {
        return t == 3 ? std::numeric_limits<float>::infinity() : 0.5F;
      });
  SilentProgress progress;
  const auto on_damaged =
      evaluate(damaged, FakeMaterial(small_info(), [](int, int, int) { return 0.0F; }), progress);
  ASSERT_FALSE(on_damaged);
  EXPECT_EQ(on_damaged.error().code, Errc::kBadFormat);
}

}  // namespace
}  // namespace veneer::btf
