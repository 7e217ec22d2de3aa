// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/renderer.h"

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

TEST(RendererAllocation, DrawDoesNotAllocateOnceWarm) {
  if (const auto context = EglContext::create(); !context) GTEST_SKIP() << context.error().what;
  Scene scene;
  scene.mesh = *load_mesh("sphere");
  scene.lights = {DirectionalLight{}, PointLight{}};
  const auto profile = example_profile(64, 48, 8);
  const auto renderer =
      Renderer::create(scene, ShaderMaterial("return vec3(view.z * light.z);"), profile, {});
  ASSERT_TRUE(renderer) << renderer.error().what;
  FrameInput input{{0, 0, 1}, {}, 0};
  const auto draw = [&](int frames) {
    for (int i = 0; i < frames; ++i) {
      input.dither_seed = static_cast<std::uint32_t>(i);
      input.eye_in_world.x() = 0.01 * i;
      (*renderer)->draw(input);
      static_cast<void>((*renderer)->statistics());
    }
  };
  draw(20);  // the driver compiles its shaders at first use
  const std::size_t before = allocations;
  draw(100);
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace veneer::render
