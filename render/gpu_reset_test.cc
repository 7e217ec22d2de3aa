// SPDX-License-Identifier: Apache-2.0
// A GPU that was reset, as its driver tells it. No driver can be asked for a reset, so that its one
// answer is replaced; all else is the real renderer.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "render/egl_context.h"
#include "render/gl_objects.h"
#include "render/internal_testing.h"
#include "render/renderer.h"

namespace veneer::render {
namespace {

constexpr int kWidth = 32;
constexpr int kHeight = 24;

GLenum told = GL_NO_ERROR;
int times_asked = 0;
GLenum what_is_told() {
  ++times_asked;
  return told;
}

class GpuReset : public ::testing::TestWithParam<GLenum> {
 protected:
  void SetUp() override {
    const auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
    if (context->description().find("does not tell of resets") != std::string::npos)
      GTEST_SKIP() << context->description();
    ask_driver_ = epoxy_glGetGraphicsResetStatus;
    told = GL_NO_ERROR;
    times_asked = 0;
    epoxy_glGetGraphicsResetStatus = what_is_told;
  }
  void TearDown() override {
    if (ask_driver_ != nullptr) epoxy_glGetGraphicsResetStatus = ask_driver_;
  }

  static std::unique_ptr<Renderer> make() {
    Scene scene;
    scene.mesh = *load_mesh("sphere");
    scene.lights = {DirectionalLight{}};
    auto renderer = Renderer::create(scene,
                                     one_level(ShaderMaterial("return vec3(0.8) * light.z;")),
                                     example_profile(kWidth, kHeight, 8),
                                     {});
    EXPECT_TRUE(renderer) << renderer.error().what;
    return renderer ? *std::move(renderer) : nullptr;
  }
  static void draw(Renderer& renderer) { renderer.draw({{0.1, 0, 1}, {}, 3}); }
  static std::vector<Rgb16> codes_of(Renderer& renderer) {
    Image<Rgb16> codes(kWidth, kHeight, {255, 255, 255});  // nothing of it may be left
    renderer.read_codes(codes.view());
    const auto pixels = codes.pixels();
    return {pixels.begin(), pixels.end()};
  }
  static int brightest(const std::vector<Rgb16>& codes) {
    int brightest = 0;
    for (const Rgb16& pixel : codes)
      for (int c = 0; c < 3; ++c) brightest = std::max<int>(brightest, pixel[c]);
    return brightest;
  }

 private:
  PFNGLGETGRAPHICSRESETSTATUSPROC ask_driver_ = nullptr;
};

TEST_P(GpuReset, IsToldHandsOutNothingBrightAndANewRendererDrawsAsBefore) {
  const std::unique_ptr<Renderer> before = make();
  ASSERT_NE(before, nullptr);
  draw(*before);
  const std::vector<Rgb16> picture = codes_of(*before);
  ASSERT_GT(brightest(picture), 50);
  EXPECT_FALSE(before->lost());
  EXPECT_GT(times_asked, 0) << "the driver is asked";

  // In the middle of a frame: drawn, but not read.
  draw(*before);
  told = GetParam();
  EXPECT_EQ(brightest(codes_of(*before)), 0);
  EXPECT_TRUE(before->lost());
  Image<Rgb32f> target(kWidth, kHeight, Rgb32f{9, 9, 9});
  before->read_target(target.view());
  EXPECT_TRUE(
      std::ranges::all_of(target.pixels(), [](const Rgb32f& xyz) { return xyz.isZero(0); }));

  // Drivers tell of a reset once, or until it is over: a renderer that was lost stays it.
  told = GL_NO_ERROR;
  EXPECT_TRUE(before->lost());
  draw(*before);
  EXPECT_EQ(brightest(codes_of(*before)), 0);

  const std::unique_ptr<Renderer> after = make();
  ASSERT_NE(after, nullptr);
  EXPECT_FALSE(after->lost());
  draw(*after);
  EXPECT_EQ(codes_of(*after), picture);
  EXPECT_TRUE(before->lost());
}

TEST_P(GpuReset, IsSeenByEachRendererThatThereIs) {
  const std::unique_ptr<Renderer> one = make();
  const std::unique_ptr<Renderer> other = make();
  ASSERT_TRUE(one && other);
  EXPECT_FALSE(one->lost());
  EXPECT_FALSE(other->lost());
  told = GetParam();
  EXPECT_TRUE(other->lost());
  EXPECT_TRUE(one->lost());
}

INSTANTIATE_TEST_SUITE_P(WhoeverIsToBlame,
                         GpuReset,
                         ::testing::Values(GL_GUILTY_CONTEXT_RESET,
                                           GL_INNOCENT_CONTEXT_RESET,
                                           GL_UNKNOWN_CONTEXT_RESET));

}  // namespace
}  // namespace veneer::render
