// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "render/egl_context.h"
#include "render/internal_testing.h"
#include "render/prepared_profile.h"
#include "render/renderer.h"

namespace veneer::render {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;

struct Picture {
  Image<Rgb16> codes{kWidth, kHeight};
  Image<Rgb32f> target{kWidth, kHeight};
};

bool same(const Picture& a, const Picture& b) {
  const auto codes_a = a.codes.pixels();
  const auto codes_b = b.codes.pixels();
  const auto target_a = a.target.pixels();
  const auto target_b = b.target.pixels();
  return std::equal(codes_a.begin(), codes_a.end(), codes_b.begin()) &&
         std::equal(target_a.begin(), target_a.end(), target_b.begin());
}

class ProfileExchangeTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto context = EglContext::create();
    if (!context) GTEST_SKIP() << context.error().what;
  }
  static std::unique_ptr<Renderer> renderer_of(const calibration::ProjectorProfile& profile,
                                               const RendererOptions& options) {
    Scene scene;
    scene.mesh = *load_mesh("sphere");
    scene.lights = {DirectionalLight{Eigen::Vector3d(0.3, 0.2, 1).normalized(),
                                     Eigen::Vector3d::Constant(150.0)}};
    auto renderer = Renderer::create(
        scene,
        one_level(ShaderMaterial("return vec3(0.9, 0.5 + 0.5 * uv.y, uv.x) * light.z;")),
        profile,
        options);
    if (!renderer) throw std::runtime_error(renderer.error().what);
    return std::move(*renderer);
  }
  static Picture picture_of(Renderer& renderer) {
    FrameInput input{{0.1, 0.2, 1}, {}, 7};
    renderer.draw(input);
    Picture picture;
    renderer.read_codes(picture.codes.view());
    renderer.read_target(picture.target.view());
    return picture;
  }
  static PreparedProfile prepared(const calibration::ProjectorProfile& profile,
                                  const RendererOptions& options) {
    return PreparedProfile::prepare(profile, options).value();
  }
};

// Every way in which a profile may differ from the one before it.
std::vector<calibration::ProjectorProfile> profiles() {
  std::vector<calibration::ProjectorProfile> all(5, example_profile(kWidth, kHeight, 8));
  all[1].residual = example_residual();
  all[2].surface_map = example_surface_map();
  all[2].black *= 3;
  all[3].geometry.world_from_projector = look_at({-0.3, 0.1, 0.9}, {0, 0, 0}, {0, 1, 0});
  all[3].geometry.fx *= 1.1;
  all[3].reference_distance_m = 0.8;
  all[3].residual = example_residual();
  // Levels of equal output: another number of them.
  for (auto& curve : all[4].tone_curves)
    for (std::size_t i = 0; i + 1 < curve.size(); i += 2) curve[i + 1] = curve[i];
  for (auto& curve : all[4].tone_curves) curve.back() = 1.0;
  all[4].vignetting = Image<float>(1, 1, 0.9F);
  return all;
}

TEST_F(ProfileExchangeTest, DrawsAsIfMadeForTheNewProfile) {
  for (const bool compensate : {true, false}) {
    for (const bool exchangeable : {true, false}) {
      const RendererOptions options{.compensate = compensate, .exchangeable = exchangeable};
      const auto all = profiles();
      const auto exchanged = renderer_of(all[0], options);
      Picture before = picture_of(*exchanged);
      for (const std::size_t i : {1U, 2U, 3U, 4U, 0U, 3U, 0U}) {
        const Status taken = exchanged->set_profile(prepared(all[i], options));
        ASSERT_TRUE(taken) << taken.error().what;
        Picture now = picture_of(*exchanged);
        EXPECT_TRUE(same(now, picture_of(*renderer_of(all[i], options)))) << "profile " << i;
        if (compensate) {
          EXPECT_FALSE(same(now, before)) << "profile " << i << " is no test";
        }
        before = std::move(now);
      }
    }
  }
}

TEST_F(ProfileExchangeTest, AnotherRasterIsRefusedAndTheOldProfileStays) {
  const RendererOptions options{};
  const auto renderer = renderer_of(example_profile(kWidth, kHeight, 8), options);
  const Picture before = picture_of(*renderer);
  for (const auto& other : {example_profile(kWidth + 1, kHeight, 8),
                            example_profile(kWidth, kHeight - 1, 8),
                            example_profile(kWidth, kHeight, 10)}) {
    const Status refused = renderer->set_profile(prepared(other, options));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
    EXPECT_NE(refused.error().what.find("restart"), std::string::npos) << refused.error().what;
    EXPECT_TRUE(same(picture_of(*renderer), before));
  }
}

TEST(PreparedProfile, RefusesWhatCannotBeShown) {
  auto profile = example_profile(kWidth, kHeight, 8);
  profile.ambient.x() = -1;
  EXPECT_EQ(PreparedProfile::prepare(profile, {}).error().code, Errc::kBadFormat);
  profile = example_profile(kWidth, kHeight, 8);
  EXPECT_EQ(PreparedProfile::prepare(profile, {.geometry_floor = 0}).error().code,
            Errc::kInvalidOption);
  profile.primaries = -profile.primaries;
  const auto refused = PreparedProfile::prepare(profile, {});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().what.find("white"), std::string::npos) << refused.error().what;
}

}  // namespace
}  // namespace veneer::render
