// SPDX-License-Identifier: Apache-2.0
#include "render/benchmark.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/turns.h"

namespace veneer::render {
namespace {

// Enough arithmetic that no noise hides it.
ShaderMaterial busy_material() {
  return ShaderMaterial(
      "vec3 x = view + light;"
      "for (int i = 0; i < 100; ++i) x = fract(sin(x) * 43.7 + uv.xyx);"
      "return x;");
}

TEST(RenderBench, RefusesSizesAndFrameCountsItCannotTime) {
  EXPECT_EQ(RenderBenchOptions{.width = 8}.check().error().code, Errc::kInvalidOption);
  EXPECT_EQ(RenderBenchOptions{.height = 10000}.check().error().code, Errc::kInvalidOption);
  EXPECT_EQ(RenderBenchOptions{.frames = 0}.check().error().code, Errc::kInvalidOption);
  EXPECT_TRUE(RenderBenchOptions{}.check());
}

TEST(RenderBench, TimesEveryMaterialAgainstPlain) {
  RenderBenchOptions options{.width = 200, .height = 150, .frames = 7};
  options.materials.push_back({"busy", std::make_shared<ShaderMaterial>(busy_material())});
  SilentProgress progress;
  const auto result = bench_render(options, progress);
  if (!result && result.error().code == Errc::kUnavailable) GTEST_SKIP() << result.error().what;
  ASSERT_TRUE(result) << result.error().what;
  ASSERT_EQ(result->timings.size(), 4U);
  EXPECT_EQ(result->timings[0].name, "plain");
  EXPECT_EQ(result->timings[0].ratio, 1.0);
  EXPECT_EQ(result->timings[0].fetches, 1);
  EXPECT_EQ(result->timings[2].name, "compensation");
  EXPECT_EQ(result->timings[3].name, "compensation with residual");
  EXPECT_GT(result->timings[1].ratio, 2.0);
  for (const RenderTiming& timing : result->timings) {
    EXPECT_GT(timing.ms_median, 0.0);
    EXPECT_GE(timing.ms_p95, timing.ms_median);
  }
  EXPECT_FALSE(result->renderer.empty());
}

TEST(RenderBench, TimesSmallerRastersWithTheirInterpolation) {
  RenderBenchOptions options{.width = 200, .height = 150, .frames = 7};
  const auto busy = std::make_shared<ShaderMaterial>(
      "vec3 x = view + light;"
      "for (int i = 0; i < 200; ++i) x = fract(sin(x) * 43.7 + uv.xyx);"
      "return x;");
  options.materials.push_back({"busy", busy});
  options.materials.push_back({.name = "busy scale 0.5", .material = busy, .scale = 0.5});
  SilentProgress progress;
  const auto result = bench_render(options, progress);
  if (!result && result.error().code == Errc::kUnavailable) GTEST_SKIP() << result.error().what;
  ASSERT_TRUE(result) << result.error().what;
  ASSERT_EQ(result->timings.size(), 6U);
  EXPECT_EQ(result->timings[3].name, "interpolation from 100x75");
  // A quarter of the pixels, where nearly all that is done is done for pixels.
  EXPECT_LT(result->timings[2].ms_median, 0.7 * result->timings[1].ms_median);
  EXPECT_GT(result->timings[3].ms_median, 0.0);
  options.materials[1].scale = 0.1;
  EXPECT_FALSE(options.check());
}

TEST(RenderBench, SaysWhichMaterialTheDriverRefuses) {
  RenderBenchOptions options{.width = 64, .height = 64, .frames = 3};
  options.materials.push_back({"broken", std::make_shared<ShaderMaterial>("return nonsense;")});
  SilentProgress progress;
  const auto result = bench_render(options, progress);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::kUnavailable);
}

Scene lit_plate() {
  Scene scene;
  scene.mesh = *load_mesh("plate");
  scene.lights = {DirectionalLight{}, PointLight{{0.2, 0.3, 0.8}, {20, 20, 20}}};
  return scene;
}

class SceneTimingTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
  }
  static constexpr int kWidth = 200;
  static constexpr int kHeight = 150;
  Result<RenderBenchResult> time(const std::vector<NamedLevel>& levels, int frames = 5) {
    return time_scene(scene_, profile_, viewpoints_, levels, frames, progress_);
  }
  static calibration::ProjectorProfile close_up() {
    calibration::ProjectorProfile profile = example_profile(kWidth, kHeight, 8);
    profile.geometry.fx *= 3;  // the plate fills the frame
    profile.geometry.fy *= 3;
    return profile;
  }

  Scene scene_ = lit_plate();
  calibration::ProjectorProfile profile_ = close_up();
  std::vector<FrameInput> viewpoints_{{{0, 0, 1}, {}}, {{0.3, 0, 1}, {}}};
  SilentProgress progress_;
};

TEST_F(SceneTimingTest, MoreWorkTakesLongerAndASmallerRasterTakesLess) {
  const ShaderMaterial busy = busy_material();
  const ShaderMaterial idle("return vec3(0.5);");
  const auto result = time({{"idle", {&idle, {}}},
                            {"busy", {&busy, {}}},
                            {"busy, small", {&busy, {.scale = DrawingOptions::kLeastScale}}}});
  ASSERT_TRUE(result) << result.error().what;
  ASSERT_EQ(result->timings.size(), 4U);
  EXPECT_EQ(result->timings[0].name, "plain");
  EXPECT_EQ(result->timings[0].ratio, 1.0);
  EXPECT_EQ(result->timings[0].fetches, 1);
  EXPECT_GT(result->timings[0].gpu_bytes, 0U);
  EXPECT_EQ(result->timings[2].name, "busy");
  EXPECT_GT(result->timings[2].ratio, 2.0 * result->timings[1].ratio);
  // A sixteenth of the pixels; half as long is far from what noise does.
  EXPECT_LT(result->timings[3].ratio, 0.5 * result->timings[2].ratio);
  for (const RenderTiming& timing : result->timings) {
    EXPECT_GT(timing.ms_median, 0.0);
    EXPECT_GE(timing.ms_p95, timing.ms_median);
    EXPECT_DOUBLE_EQ(timing.ratio, timing.ms_median / result->timings[0].ms_median);
  }
  EXPECT_FALSE(result->renderer.empty());
  EXPECT_FALSE(result->clock.empty());
}

TEST(PlainDraw, SumsTheLightOfAllLightsByTheirCosines) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const calibration::ProjectorProfile profile = example_profile(64, 48, 8);
  const MeshBuffers mesh(*load_mesh("sphere"));
  const btf::ModelShader textures = plain_textures();
  const auto target = DrawTarget::create({64, 48});
  ASSERT_TRUE(target) << target.error().what;
  const auto drawn = [&](const std::vector<Light>& lights) {
    const auto pass = DrawPass::create_plain(textures, lights, {1, 1}, profile);
    EXPECT_TRUE(pass) << pass.error().what;
    pass->draw(target->framebuffer(), mesh, {{0, 0, 1}, {}});
    std::vector<Eigen::Vector4f> pixels(64 * 48);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target->framebuffer());
    glReadPixels(0, 0, 64, 48, GL_RGBA, GL_FLOAT, pixels.data());
    return pixels;
  };
  const Eigen::Vector3d direction = Eigen::Vector3d(0.3, 0.5, 0.8).normalized();
  const DirectionalLight sun{direction, {1, 2, 3}};
  const DirectionalLight low{{1, 0, 0}, {3, 2, 1}};
  constexpr double kFar = 500;  // times its square, a candela is a lux
  const PointLight lamp{kFar * direction, kFar * kFar * sun.illuminance_rgb};
  const auto first = drawn({sun});
  const auto second = drawn({low});
  const auto both = drawn({sun, low});
  const auto with_lamp = drawn({lamp, low});
  float brightest = 0;
  // Half floats of three draws, cut or rounded; the lamp is nearer by a tenth of a metre in kFar.
  constexpr float kTolerance = 3e-3F;
  for (std::size_t i = 0; i < both.size(); ++i) {
    const Eigen::Vector3f sum = (first[i] + second[i]).head<3>();
    EXPECT_LE((both[i].head<3>() - sum).norm(), kTolerance * sum.norm()) << i;
    EXPECT_LE((with_lamp[i] - both[i]).head<3>().norm(), kTolerance) << i;
    brightest = std::max(brightest, sum.maxCoeff());
  }
  EXPECT_GT(brightest, 0.3F);
}

TEST_F(SceneTimingTest, RefusesWhatCannotBeTimed) {
  const ShaderMaterial idle("return vec3(0.5);");
  const auto code = [](const Result<RenderBenchResult>& result) {
    return result ? std::optional<Errc>() : result.error().code;
  };
  EXPECT_EQ(code(time({}, 2)), Errc::kInvalidOption);
  EXPECT_EQ(code(time({{"tiny", {&idle, {.scale = 0.1}}}})), Errc::kInvalidOption);
  const Scene lit = scene_;
  scene_.lights.clear();
  EXPECT_EQ(code(time({})), Errc::kBadFormat);
  scene_ = lit;
  viewpoints_.clear();
  EXPECT_EQ(code(time({})), Errc::kInvalidOption);
}

TEST_F(SceneTimingTest, SaysWhichLevelTheDriverRefuses) {
  const ShaderMaterial broken("return nonsense;");
  const auto result = time({{"the broken one", {&broken, {}}}});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::kUnavailable);
  EXPECT_NE(result.error().what.find("the broken one"), std::string::npos) << result.error().what;
}

}  // namespace
}  // namespace veneer::render
