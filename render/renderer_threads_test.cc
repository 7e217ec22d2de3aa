// SPDX-License-Identifier: Apache-2.0
// A renderer goes from thread to thread: renderer.h, egl_context.h.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <latch>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/prepared_profile.h"
#include "render/renderer.h"

namespace veneer::render {
namespace {

constexpr int kWidth = 80;
constexpr int kHeight = 60;

class RendererThreadsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
  }

  // @param which  which of two materials and profiles.
  static std::unique_ptr<Renderer> make(int which,
                                        const RendererOptions& options = {},
                                        const DrawingOptions& drawing = {}) {
    Scene scene;
    scene.mesh = *load_mesh("sphere");
    scene.lights = {DirectionalLight{Eigen::Vector3d(0.3, 0.2, 1).normalized(),
                                     Eigen::Vector3d::Constant(150.0)}};
    auto profile = example_profile(kWidth, kHeight, 8);
    if (which == 1) profile.residual = example_residual();
    const ShaderMaterial material(which == 0
                                      ? "return vec3(0.9, 0.5 + 0.5 * uv.y, uv.x) * light.z;"
                                      : "return vec3(uv, 0.3) * max(light.z * view.z, 0.0);");
    auto renderer = Renderer::create(scene, one_level(material, drawing), profile, options);
    if (!renderer) throw std::runtime_error(renderer.error().what);
    return std::move(*renderer);
  }
  static std::vector<Rgb16> frame(Renderer& renderer, int number) {
    FrameInput input{{0.1, 0.02 * number, 1}, {}, static_cast<std::uint32_t>(number)};
    renderer.draw(input);
    Image<Rgb16> codes(kWidth, kHeight);
    renderer.read_codes(codes.view());
    const auto pixels = codes.pixels();
    return {pixels.begin(), pixels.end()};
  }
  static std::vector<std::vector<Rgb16>> frames(Renderer& renderer, int from, int to) {
    std::vector<std::vector<Rgb16>> all;
    for (int number = from; number < to; ++number) all.push_back(frame(renderer, number));
    return all;
  }
  static void on_a_thread(const std::function<void()>& work) { std::thread(work).join(); }
};

TEST_F(RendererThreadsTest, HandedOverItDrawsWhatOneMadeInPlaceDraws) {
  for (const int which : {0, 1})
    for (const Evaluation evaluation : {Evaluation::kFragment, Evaluation::kCompute}) {
      const RendererOptions options{.exchangeable = true};
      const DrawingOptions drawing{.evaluation = evaluation};
      const auto wanted = frames(*make(which, options, drawing), 0, 3);
      std::unique_ptr<Renderer> renderer;
      on_a_thread([&] {
        renderer = make(which, options, drawing);
        renderer->release();
      });
      EXPECT_FALSE(renderer->lost());
      EXPECT_EQ(frames(*renderer, 0, 2), (std::vector{wanted[0], wanted[1]}));
      renderer->release();
      on_a_thread([&] {
        EXPECT_EQ(frame(*renderer, 2), wanted[2]);
        renderer->finish();
        EXPECT_GT(renderer->statistics().covered_pixels, 0U);
        renderer->release();
      });
      // Goes on a thread that never drew, with counts of frames still to be fetched.
      on_a_thread([&] { renderer.reset(); });
    }
}

TEST_F(RendererThreadsTest, GoesOnTheThreadThatMadeItOrDrewLast) {
  const auto wanted = frame(*make(0), 0);
  on_a_thread([&] { EXPECT_EQ(frame(*make(0), 0), wanted); });  // without release()
  std::unique_ptr<Renderer> renderer = make(0);
  renderer->release();
  on_a_thread([&] {
    EXPECT_EQ(frame(*renderer, 0), wanted);
    renderer.reset();
  });
  EXPECT_EQ(frame(*make(0), 0), wanted) << "the display is still there";
}

TEST_F(RendererThreadsTest, ProfilesAreExchangedAfterAHandOver) {
  auto other = example_profile(kWidth, kHeight, 8);
  other.residual = example_residual();
  other.black *= 2;
  const RendererOptions options{.exchangeable = true};
  const auto prepared = PreparedProfile::prepare(other, options);
  ASSERT_TRUE(prepared);
  const auto in_place = make(0, options);
  ASSERT_TRUE(in_place->set_profile(*prepared));
  const auto wanted = frame(*in_place, 0);
  in_place->release();
  std::unique_ptr<Renderer> renderer;
  on_a_thread([&] {
    renderer = make(0, options);
    renderer->release();
  });
  ASSERT_TRUE(renderer->set_profile(*prepared));
  EXPECT_EQ(frame(*renderer, 0), wanted);
}

// What the daemon does when it is told to load another material: the old one goes on drawing
// meanwhile, and goes on a thread of its own.
TEST_F(RendererThreadsTest, OneDrawsWhileOthersAreMadeAndGo) {
  constexpr int kOthers = 6;
  const auto wanted = frame(*make(0), 7);
  const auto wanted_of_others = frame(*make(1), 5);
  std::atomic<bool> done = false;
  std::atomic<int> drawn = 0;
  std::atomic<int> wrong = 0;
  std::unique_ptr<Renderer> drawing = make(0);
  drawing->release();
  std::thread frames_thread([&] {
    while (!done || drawn < 5) {
      wrong += frame(*drawing, 7) == wanted ? 0 : 1;
      ++drawn;
    }
    drawing->release();
  });
  std::vector<std::unique_ptr<Renderer>> made(kOthers);
  on_a_thread([&] {
    for (auto& renderer : made) {
      renderer = make(1);
      renderer->release();
    }
  });
  for (auto& renderer : made) {
    on_a_thread([&] {
      wrong += frame(*renderer, 5) == wanted_of_others ? 0 : 1;
      renderer.reset();
    });
  }
  done = true;
  frames_thread.join();
  EXPECT_EQ(wrong, 0) << "of " << drawn << " frames";
}

// The display is shared by all and ended by the last: whoever comes while the last one goes must
// not find it ended.
TEST_F(RendererThreadsTest, ComingAndGoingAtOnceKeepsTheDisplay) {
  constexpr int kRounds = 40;
  std::latch start(2);
  std::atomic<int> failed = 0;
  const auto come_and_go = [&] {
    start.arrive_and_wait();
    for (int i = 0; i < kRounds; ++i) {
      const auto context = EglContext::create();
      if (!context || context->lost()) ++failed;
    }
  };
  std::thread other(come_and_go);
  come_and_go();
  other.join();
  EXPECT_EQ(failed, 0);
}

}  // namespace
}  // namespace veneer::render
