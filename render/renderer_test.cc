// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/colour.h"
#include "render/compensation.h"
#include "render/internal_renderer_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

TEST_F(RendererTest, PutsTextureCoordinatesWhereProjectionByHandPutsThem) {
  expect_everywhere(
      plate_scene(), ShaderMaterial("return vec3(uv, 0.5);"), [](const Vector3d& point) {
        return Vector3d(point.x() / 0.2 + 0.5, 0.5 - point.y() / 0.2, 0.5);
      });
}

TEST_F(RendererTest, GivesModelsTheViewInTheLocalFrame) {
  expect_everywhere(plate_scene(),
                    ShaderMaterial("return 0.5 + 0.5 * view;"),
                    [](const Vector3d& point) -> Vector3d {
                      const FrameInput input = tilted_frame();
                      const Vector3d eye = input.world_from_object.inverse() * input.eye_in_world;
                      return Vector3d::Constant(0.5) + 0.5 * (eye - point).normalized();
                    });
}

TEST_F(RendererTest, GivesModelsTheLightInTheLocalFrame) {
  expect_everywhere(
      plate_scene(), ShaderMaterial("return 0.5 + 0.5 * light;"), [](const Vector3d&) -> Vector3d {
        const Vector3d light =
            std::get<DirectionalLight>(plate_scene().lights[0]).direction_to_light;
        return Vector3d::Constant(0.5) +
               0.5 * (tilted_frame().world_from_object.rotation.conjugate() * light);
      });
}

TEST_F(RendererTest, AddsUpLightsAndFollowsTheInverseSquareLaw) {
  Scene scene = plate_scene();
  const PointLight lamp{{0.1, 0.2, 0.4}, {0.1, 0.2, 0.3}};
  scene.lights.emplace_back(lamp);
  expect_everywhere(
      scene, ShaderMaterial("return vec3(light.z);"), [&](const Vector3d& point) -> Vector3d {
        const FrameInput input = tilted_frame();
        const Vector3d to_sun =
            input.world_from_object.rotation.conjugate() *
            std::get<DirectionalLight>(plate_scene().lights[0]).direction_to_light;
        const Vector3d to_lamp = input.world_from_object.inverse() * lamp.position - point;
        return Vector3d::Constant(to_sun.z()) +
               lamp.intensity_rgb / kPi * (to_lamp.z() / std::pow(to_lamp.norm(), 3));
      });
}

// The weight reaches a material's shader, drawn per pixel or as the mean of texels, in either
// stage.
TEST_F(RendererTest, FadesTheSpecularTerm) {
  const ShaderMaterial shiny("return vec3(0.2, 0.3, 0.1) + SPECULAR_WEIGHT * vec3(0.4);");
  for (const Evaluation evaluation : {Evaluation::kFragment, Evaluation::kCompute})
    for (const bool average : {false, true}) {
      const auto renderer =
          make(plate_scene(), shiny, {.average_texels = average, .evaluation = evaluation});
      for (const double weight : {1.0, 0.25, 0.0}) {
        FrameInput input{{0, 0, 1}, {}, 0};
        EXPECT_EQ(input.specular_weight, 1.0);
        input.specular_weight = weight;
        renderer->draw(input);
        Image<Rgb32f> target(kWidth, kHeight);
        renderer->read_target(target.view());
        int covered = 0;
        for (const Rgb32f& pixel : target.pixels()) {
          if (pixel.norm() == 0) continue;
          const Vector3d shown = srgb_from_xyz() * pixel.cast<double>();
          const Vector3d wanted = Vector3d(0.2, 0.3, 0.1) + Vector3d::Constant(0.4 * weight);
          ASSERT_LT((shown - wanted).norm(), kHalfFloatTolerance);
          ++covered;
        }
        EXPECT_GT(covered, 500);
      }
    }
}

TEST_F(RendererTest, RefusesTheAngularCacheInAComputePass) {
  const auto renderer =
      Renderer::create(plate_scene(),
                       one_level(ShaderMaterial("return vec3(1.0);"),
                                 {.cache = {.spacing = 16}, .evaluation = Evaluation::kCompute}),
                       profile_,
                       {});
  ASSERT_FALSE(renderer);
  EXPECT_EQ(renderer.error().code, Errc::kInvalidOption);
  EXPECT_EQ(parse_evaluation("compute"), Evaluation::kCompute);
  EXPECT_EQ(parse_evaluation("fragment"), Evaluation::kFragment);
  for (const char* text : {"", "Compute", "compute "}) EXPECT_FALSE(parse_evaluation(text));
}

TEST_F(RendererTest, ShowsTheNearSideOfASphere) {
  const Scene scene =
      scene_of("sphere", DirectionalLight{Vector3d::UnitZ(), Vector3d::Constant(kPi)});
  const auto renderer = make(scene, ShaderMaterial("return vec3(uv, 0.5);"));
  const FrameInput input{};  // at the origin
  renderer->draw({{0, 0, 1}, {}, 0});
  Image<Rgb32f> target(kWidth, kHeight);
  renderer->read_target(target.view());
  // The sphere is made of flat triangles 1/128 of a turn wide: where the ray meets one, the texture
  // coordinate differs from the sphere's by less than this.
  constexpr double kFacetTolerance = 0.02;
  int compared = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Ray ray = ray_in_object(input, x + 0.5, y + 0.5);
      const double a = ray.along.squaredNorm();
      const double b = ray.along.dot(ray.from);
      const double discriminant = b * b - a * (ray.from.squaredNorm() - 0.01);
      if (discriminant < 0.05 * a * 0.01) continue;  // misses or grazes
      const Vector3d n = (ray.from + ray.along * ((-b - std::sqrt(discriminant)) / a)) / 0.1;
      if (std::abs(n.y()) > 0.9) continue;  // at the poles u turns quickly
      const Vector3d wanted(
          std::atan2(n.x(), n.z()) / (2 * kPi) + 0.5, std::acos(n.y()) / kPi, 0.5);
      const Vector3d shown = srgb_from_xyz() * target(x, y).cast<double>();
      ASSERT_LT((shown - wanted).norm(), kFacetTolerance) << x << ", " << y;
      ++compared;
    }
  }
  EXPECT_GT(compared, 200);
}

TEST_F(RendererTest, TheBackOfAPlateIsNotCovered) {
  const auto renderer = make(plate_scene(), ShaderMaterial("return vec3(1.0);"));
  FrameInput input;
  input.eye_in_world = {0, 0, 1};
  input.world_from_object.rotation = Eigen::AngleAxisd(kPi, Vector3d::UnitY());
  renderer->draw(input);
  renderer->finish();
  EXPECT_EQ(renderer->statistics().covered_pixels, 0U);
  Image<Rgb32f> target(kWidth, kHeight, Rgb32f::Ones());
  renderer->read_target(target.view());
  for (const Rgb32f& pixel : target.pixels()) ASSERT_EQ(pixel, Rgb32f::Zero());
}

// What the codes make the modelled machine send, pixel by pixel with G by hand, is the target.
TEST_F(RendererTest, CodesSendTheTarget) {
  for (const int bits : {8, 10}) {
    profile_ = example_profile(kWidth, kHeight, bits);
    const Image<float> vignetting = vignetting_raster(profile_);
    Scene scene = plate_scene();
    scene.lights = {DirectionalLight{Vector3d::UnitZ(), Vector3d::Constant(60 * kPi)}};
    const auto renderer =
        make(scene, ShaderMaterial("return vec3(0.4 + 0.4 * uv, 0.6);"), {}, {.dither = false});
    const FrameInput input = tilted_frame();
    renderer->draw(input);
    Image<Rgb32f> target(kWidth, kHeight);
    Image<Rgb16> codes(kWidth, kHeight);
    renderer->read_target(target.view());
    renderer->read_codes(codes.view());
    const auto& g = profile_.geometry;
    const Eigen::Matrix3d surface_and_primaries = profile_.surface * profile_.primaries;
    std::uint64_t covered = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (target(x, y).norm() == 0) {
          ASSERT_EQ(codes(x, y), Rgb16{}) << x << ", " << y;
          continue;
        }
        ++covered;
        const auto point = point_on_plate(input, x + 0.5, y + 0.5);
        if (!point) continue;
        const Vector3d to_projector =
            (input.world_from_object.inverse() * g.world_from_projector.translation) - *point;
        const double geometry = to_projector.z() / to_projector.norm() *
                                std::pow(profile_.reference_distance_m / to_projector.norm(), 2) *
                                vignetting(x, y);
        Vector3d drive;
        Vector3d step;  // between neighbouring codes, in linear light
        for (int c = 0; c < 3; ++c) {
          const auto& curve = profile_.tone_curves[static_cast<std::size_t>(c)];
          const std::size_t code = codes(x, y)[static_cast<std::size_t>(c)];
          drive[c] = curve[code];
          step[c] = curve[std::min(code + 1, curve.size() - 1)] - curve[code - 1];
        }
        const Xyz sent =
            profile_.surface *
            (geometry * (profile_.primaries * drive + profile_.black) + profile_.ambient);
        // Half a step up or down; seen from the middle of three codes, a quarter of their span, and
        // some more where the curve bends. And G and the target are half floats.
        const Vector3d allowed = 0.3 * geometry * surface_and_primaries.cwiseAbs() * step +
                                 2e-3 * target(x, y).cast<double>();
        const Vector3d off = (sent - target(x, y).cast<double>()).cwiseAbs();
        ASSERT_TRUE((off.array() <= allowed.array()).all())
            << bits << " bits, pixel " << x << ", " << y << ": off " << off.transpose()
            << ", allowed " << allowed.transpose();
      }
    }
    renderer->finish();
    const FrameStatistics statistics = renderer->statistics();
    EXPECT_EQ(statistics.covered_pixels, covered);
    EXPECT_EQ(statistics.out_of_gamut_pixels, 0U);
    EXPECT_EQ(statistics.out_of_reach_pixels, 0U);
    EXPECT_EQ(statistics.gamut_loss_mean, 0.0);
    EXPECT_GT(covered, 500U);
  }
}

TEST_F(RendererTest, CountsWhatIsOutOfGamutAndOutOfReach) {
  Scene scene = plate_scene();
  scene.lights = {DirectionalLight{Vector3d::UnitZ(), Vector3d::Constant(1e4)}};
  const ShaderMaterial white("return vec3(1.0);");
  const auto bright = make(scene, white);
  bright->draw(tilted_frame());
  bright->finish();
  EXPECT_GT(bright->statistics().covered_pixels, 0U);
  EXPECT_EQ(bright->statistics().out_of_gamut_pixels, bright->statistics().covered_pixels);
  EXPECT_GT(bright->statistics().gamut_loss_mean, 1.0);
  const auto far = make(scene, white, {}, {.geometry_floor = 50.0});
  far->draw(tilted_frame());
  far->finish();
  EXPECT_EQ(far->statistics().out_of_reach_pixels, far->statistics().covered_pixels);
  Image<Rgb16> codes(kWidth, kHeight, Rgb16{1, 1, 1});
  far->read_codes(codes.view());
  for (const Rgb16& pixel : codes.pixels()) ASSERT_EQ(pixel, Rgb16{});
}

TEST_F(RendererTest, TwoRenderersTakeTurnsOnOneThread) {
  const auto red = make(plate_scene(), ShaderMaterial("return vec3(1.0, 0.0, 0.0);"));
  auto green = make(plate_scene(), ShaderMaterial("return vec3(0.0, 1.0, 0.0);"));
  red->draw(tilted_frame());
  green->draw(tilted_frame());
  green.reset();
  Image<Rgb32f> target(kWidth, kHeight);
  red->read_target(target.view());
  double most = 0;
  for (const Rgb32f& pixel : target.pixels())
    most = std::max(most, (srgb_from_xyz() * pixel.cast<double>()).x());
  EXPECT_NEAR(most, 1.0, kHalfFloatTolerance);
}

TEST_F(RendererTest, TimesFramesWithoutWaiting) {
  // Enough arithmetic that issuing the commands is nothing beside it.
  const auto renderer =
      make(plate_scene(),
           ShaderMaterial("vec3 x = view + light;"
                          "for (int i = 0; i < 300; ++i) x = fract(sin(x) * 43.7 + uv.xyx);"
                          "return x;"));
  EXPECT_FALSE(renderer->statistics().gpu_ms.has_value());
  std::vector<double> clock_ms;
  std::vector<double> drawn;  // the draw pass's part of the GPU's time
  for (int i = 0; i < 10; ++i) {
    const auto start = std::chrono::steady_clock::now();
    renderer->draw(tilted_frame());
    renderer->finish();
    clock_ms.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
    const FrameStatistics statistics = renderer->statistics();
    ASSERT_TRUE(statistics.gpu_ms && statistics.draw_ms);
    EXPECT_GT(*statistics.draw_ms, 0.0);
    EXPECT_LT(*statistics.draw_ms, *statistics.gpu_ms);
    drawn.push_back(*statistics.draw_ms / *statistics.gpu_ms);
  }
  const auto gpu_ms = renderer->statistics().gpu_ms;
  ASSERT_TRUE(gpu_ms.has_value());
  // The GPU's share of the last frame: most of it, and no more than all.
  EXPECT_GT(*gpu_ms, 0.3 * clock_ms.back());
  EXPECT_LT(*gpu_ms, 1.05 * clock_ms.back());
  // Most of it is the draw pass; the median, as a busy machine stretches any part.
  std::sort(drawn.begin(), drawn.end());
  EXPECT_GT(drawn[drawn.size() / 2], 0.5);
}

// On any doubt dark: a frame whose input is no number shows nothing, and the next one is as ever.
TEST_F(RendererTest, WhatIsNoNumberIsDark) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  constexpr double kTooLarge = 1e300;  // for single precision
  // A material that would hide a bad eye: it is white whatever the view is.
  const ShaderMaterial white("return vec3(4.0 + 0.0 * clamp(view.x, 0.0, 1.0));");
  for (const Evaluation evaluation : {Evaluation::kFragment, Evaluation::kCompute}) {
    const auto renderer = make(plate_scene(), white, {.evaluation = evaluation});
    const auto codes = [&](const FrameInput& input) {
      renderer->draw(input);
      Image<Rgb16> image(kWidth, kHeight);
      renderer->read_codes(image.view());
      const auto pixels = image.pixels();
      return std::vector<Rgb16>(pixels.begin(), pixels.end());
    };
    const std::vector<Rgb16> dark(kWidth * kHeight, Rgb16{});
    const std::vector<Rgb16> sound = codes(tilted_frame());
    ASSERT_NE(sound, dark);
    for (const double bad : {kNan, kInf, -kInf, kTooLarge}) {
      std::vector<FrameInput> inputs(5, tilted_frame());
      inputs[0].eye_in_world.y() = bad;
      inputs[1].world_from_object.translation.x() = bad;
      inputs[2].world_from_object.rotation.w() = bad;
      inputs[3].world_from_object.rotation.z() = bad;
      inputs[4].specular_weight = bad;
      for (std::size_t i = 0; i < inputs.size(); ++i) {
        EXPECT_EQ(codes(inputs[i]), dark) << "input " << i << ": " << bad;
        EXPECT_EQ(codes(tilted_frame()), sound) << "after input " << i << ": " << bad;
      }
    }
    for (const double weight : {-1e-9, 1.0 + 1e-9}) {
      FrameInput input = tilted_frame();
      input.specular_weight = weight;
      EXPECT_EQ(codes(input), dark) << weight;
    }
  }
  // A target that is no number is out of reach.
  for (const char* body : {"return vec3(sqrt(-view.z));",
                           "return vec3(1.0 / min(view.z, 0.0));",
                           "return vec3(1.0, sqrt(-view.z), 1.0);",
                           "return vec3(1e38) * 1e38;"}) {
    const auto renderer = make(plate_scene(), ShaderMaterial(body));
    renderer->draw(tilted_frame());
    Image<Rgb16> image(kWidth, kHeight);
    renderer->read_codes(image.view());
    Image<Rgb32f> target(kWidth, kHeight);
    renderer->read_target(target.view());
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        ASSERT_EQ(image(x, y), Rgb16{}) << body << ": " << target(x, y).transpose();
    renderer->finish();
    EXPECT_GT(renderer->statistics().out_of_reach_pixels, 500U) << body;
  }
}

TEST_F(RendererTest, RefusesWhatItCannotDraw) {
  const ShaderMaterial white("return vec3(1.0);");
  const auto refused =
      [&](const Scene& scene, const btf::Material& material, const RendererOptions& options) {
        const auto renderer = Renderer::create(scene, one_level(material), profile_, options);
        return renderer ? std::string() : renderer.error().what;
      };
  EXPECT_NE(refused(plate_scene(), white, {.geometry_floor = 0}).find("geometry_floor"),
            std::string::npos);
  Scene dark = plate_scene();
  dark.lights.clear();
  EXPECT_NE(refused(dark, white, {}).find("lights"), std::string::npos);
  Scene torn = plate_scene();
  torn.mesh.triangles[3][1] = 1000000;
  EXPECT_NE(refused(torn, white, {}).find("1000000"), std::string::npos);
  Scene bare = plate_scene();
  bare.mesh.texture_coordinates.clear();
  EXPECT_NE(refused(bare, white, {}).find("texture coordinates"), std::string::npos);
  EXPECT_NE(refused(plate_scene(), ShaderMaterial("return nonsense;"), {}).find("nonsense"),
            std::string::npos);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const Light& light : {Light(DirectionalLight{{0, kNan, 1}, {1, 1, 1}}),
                             Light(DirectionalLight{{0, 0, 1}, {1, kNan, 1}}),
                             Light(PointLight{{kNan, 0, 1}, {1, 1, 1}}),
                             Light(PointLight{{0, 0, 1}, {1, 1, HUGE_VAL}})}) {
    Scene blinding = plate_scene();
    blinding.lights.push_back(light);
    EXPECT_NE(refused(blinding, white, {}).find("no number"), std::string::npos);
  }
  profile_.primaries.col(0).setZero();
  EXPECT_NE(refused(plate_scene(), white, {}), "");
}

}  // namespace
}  // namespace veneer::render
