// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <new>

#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/renderer.h"
#include "render/scanout_pass.h"

namespace {

// Allocations of this thread; the driver's worker threads may do as they like.
thread_local std::size_t allocations = 0;

}  // namespace

// Replaces the program's global operator new (and with it new[], which calls it) by one that
// counts.
void* operator new(std::size_t bytes) {
  ++allocations;
  if (void* memory = std::malloc(bytes > 0 ? bytes : 1)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t /*bytes*/) noexcept { std::free(memory); }

namespace veneer::render {
namespace {

TEST(RendererAllocation, CountingWorks) {
  const std::size_t before = allocations;
  ::operator delete(::operator new(1));  // a new-expression may be optimised away
  EXPECT_EQ(allocations, before + 1);
}

TEST(RendererAllocation, AFrameDoesNotAllocateOnceWarm) {
  if (const auto context = EglContext::create(); !context) GTEST_SKIP() << context.error().what;
  Scene scene;
  scene.mesh = *load_mesh("sphere");
  scene.lights = {DirectionalLight{}, PointLight{}};
  const auto profile = example_profile(64, 48, 8);
  const auto renderer =
      Renderer::create(scene,
                       one_level(ShaderMaterial("return vec3(view.z * light.z);")),
                       profile,
                       {.luminance_ceiling = 1.0});
  ASSERT_TRUE(renderer) << renderer.error().what;
  FrameInput input{{0, 0, 1}, {}, 0};
  const auto draw = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      input.dither_seed = static_cast<std::uint32_t>(i);
      input.eye_in_world.x() = i % 10 == 9 ? NAN : 0.01 * i;  // a dark frame now and then
      (*renderer)->draw(input);
      static_cast<void>((*renderer)->statistics());
      static_cast<void>((*renderer)->lost());
    }
  };
  draw(20);  // the driver compiles its shaders at first use
  const std::size_t before = allocations;
  draw(100);
  EXPECT_EQ(allocations, before);
}

TEST(RendererAllocation, AFadeBetweenLevelsDoesNotAllocateOnceWarm) {
  if (const auto context = EglContext::create(); !context) GTEST_SKIP() << context.error().what;
  Scene scene;
  scene.mesh = *load_mesh("sphere");
  scene.lights = {DirectionalLight{}};
  const ShaderMaterial plain("return vec3(view.z * light.z);");
  const ShaderMaterial smooth(smooth_model());
  const std::vector<Level> levels{{&plain, {}},
                                  {&plain, {.evaluation = Evaluation::kCompute}},
                                  {&plain, {.scale = 0.5}},
                                  {&plain, {.evaluation = Evaluation::kCompute, .scale = 0.5}},
                                  {&smooth, {.cache = {.spacing = 8}, .scale = 0.7}}};
  const auto renderer = Renderer::create(scene, levels, example_profile(64, 48, 8), {});
  ASSERT_TRUE(renderer) << renderer.error().what;
  FrameInput input{{0, 0, 1}, {}, 0};
  const auto draw_all = [&] {
    for (input.level = 0; input.level < levels.size(); ++input.level) {
      for (input.next_level = 0; input.next_level < levels.size(); ++input.next_level) {
        for (const double fade : {0.0, 0.3, 1.0}) {
          input.fade = fade;
          (*renderer)->draw(input);
          static_cast<void>((*renderer)->statistics());
        }
      }
    }
  };
  draw_all();
  const std::size_t before = allocations;
  draw_all();
  EXPECT_EQ(allocations, before);
}

// What draw_to_scanout() does, into a texture in place of a display's buffer.
TEST(RendererAllocation, ScanningOutDoesNotAllocateOnceWarm) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  constexpr int kSide = 32;
  const auto pass = ScanoutPass::create(8);
  ASSERT_TRUE(pass) << pass.error().what;
  const GlTexture codes = make_texture_2d(GL_RGBA16UI, kSide, kSide);
  const GlTexture target = make_texture_2d(GL_RGBA8, kSide, kSide);
  const GlFramebuffer framebuffer = make_framebuffer();
  glNamedFramebufferTexture(framebuffer.id(), GL_COLOR_ATTACHMENT0, target.id(), 0);
  const auto run = [&](int frames) {
    for (int i = 0; i < frames; ++i) pass->run(codes.id(), framebuffer.id(), 8, kSide, kSide);
  };
  run(5);
  const std::size_t before = allocations;
  run(50);
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace veneer::render
