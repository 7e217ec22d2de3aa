// SPDX-License-Identifier: Apache-2.0
#include "render/benchmark.h"

#include <gtest/gtest.h>

#include "render/internal_testing.h"

namespace veneer::render {
namespace {

TEST(RenderBench, RefusesSizesAndFrameCountsItCannotTime) {
  EXPECT_EQ(RenderBenchOptions{.width = 8}.check().error().code, Errc::kInvalidOption);
  EXPECT_EQ(RenderBenchOptions{.height = 10000}.check().error().code, Errc::kInvalidOption);
  EXPECT_EQ(RenderBenchOptions{.frames = 0}.check().error().code, Errc::kInvalidOption);
  EXPECT_TRUE(RenderBenchOptions{}.check());
}

TEST(RenderBench, TimesEveryMaterialAgainstPlain) {
  RenderBenchOptions options{.width = 200, .height = 150, .frames = 7};
  // Enough arithmetic that no noise hides it.
  options.materials.push_back(
      {"busy",
       std::make_shared<ShaderMaterial>(
           "vec3 x = view + light;"
           "for (int i = 0; i < 100; ++i) x = fract(sin(x) * 43.7 + uv.xyx);"
           "return x;")});
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

}  // namespace
}  // namespace veneer::render
