// SPDX-License-Identifier: Apache-2.0
// What a renderer shows of the sample's texels and mip levels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <vector>

#include "base/colour.h"
#include "render/internal_renderer_testing.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

class RendererTexelsTest : public RendererTest {};

TEST_F(RendererTexelsTest, RepeatsTheSample) {
  Scene scene = plate_scene();
  scene.texture_repeats = {6, 3};
  expect_everywhere(scene, ShaderMaterial("return vec3(uv, 0.5);"), [](const Vector3d& point) {
    return Vector3d(6 * (point.x() / 0.2 + 0.5), 3 * (0.5 - point.y() / 0.2), 0.5);
  });
}

// A texture of 4 x 4 texels, all different; the first is the upper left one of the sample, which is
// the upper left one of the plate seen from outside.
TEST_F(RendererTexelsTest, ShowsTheFirstTexelAtTheUpperLeft) {
  btf::ModelShader shader;
  shader.source =
      "uniform sampler2D Texels;"
      "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {"
      "return texelFetch(Texels, ivec2(uv * 4.0), 0).rgb; }";
  btf::ModelTexture texture;
  texture.sampler = "Texels";
  texture.format = btf::TexelFormat::kRgba32f;
  texture.width = texture.height = 4;
  std::vector<float> texels;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column)
      texels.insert(texels.end(), {0.25F + 0.1F * column, 0.25F + 0.1F * row, 0.5F, 1.0F});
  }
  const auto* bytes = reinterpret_cast<const std::byte*>(texels.data());
  texture.data.assign(bytes, bytes + texels.size() * sizeof(float));
  shader.textures.push_back(texture);
  expect_everywhere(plate_scene(), ShaderMaterial(shader), [](const Vector3d& point) {
    // Within rounding of a border the pixel may show either texel; the plate's tilt puts few there.
    const auto texel = [](double part) { return std::clamp(static_cast<int>(part * 4), 0, 3); };
    return Vector3d(
        0.25 + 0.1 * texel(point.x() / 0.2 + 0.5), 0.25 + 0.1 * texel(0.5 - point.y() / 0.2), 0.5);
  });
}

btf::ModelShader shader_of_levels() {
  btf::ModelShader shader;
  shader.source =
      "int texel_level = 0;\n"
      "vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) { return vec3(texel_level + 1); }";
  return shader;
}

// A material that shows which mip level is read.
class LevelMaterial final : public ShaderMaterial {
 public:
  LevelMaterial(int side, int levels)
      : ShaderMaterial(shader_of_levels()), side_(side), levels_(levels) {}
  [[nodiscard]] int width() const override { return side_; }
  [[nodiscard]] int height() const override { return side_; }
  [[nodiscard]] int mip_levels() const override { return levels_; }

 private:
  int side_;
  int levels_;
};

TEST_F(RendererTexelsTest, ReadsTheMipLevelThatSuitsThePixel) {
  constexpr double kNearlyBetween = 0.1;  // where interpolation in float may choose the other
  const FrameInput input = tilted_frame();
  constexpr int kLevels = 5;
  std::set<int> seen;
  for (const int side : {16, 50, 100, 220, 500, 3000})
    for (const bool average : {false, true}) {
      const auto renderer =
          make(plate_scene(), LevelMaterial(side, kLevels), {.average_texels = average});
      renderer->draw(input);
      Image<Rgb32f> target(kWidth, kHeight);
      renderer->read_target(target.view());
      int compared = 0;
      for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
          const auto at = [&](double dx, double dy) {
            return point_on_plate(input, x + 0.5 + dx, y + 0.5 + dy);
          };
          if (!at(-2, -2) || !at(2, -2) || !at(-2, 2) || !at(2, 2)) continue;
          const Vector3d width =
              (*at(0.5, 0) - *at(-0.5, 0)).cwiseAbs() + (*at(0, 0.5) - *at(0, -0.5)).cwiseAbs();
          const double level =
              std::clamp(std::log2(width.maxCoeff() / 0.2 * side), 0.0, kLevels - 1.0);
          if (std::abs(level - std::floor(level) - 0.5) < kNearlyBetween) continue;
          const auto shown = (srgb_from_xyz() * target(x, y).cast<double>()).y() - 1;
          ASSERT_NEAR(shown, std::round(level), 0.01) << side << " texels at " << x << ", " << y;
          seen.insert(static_cast<int>(std::round(level)));
          ++compared;
        }
      EXPECT_GT(compared, 100) << side;
    }
  EXPECT_EQ(seen, (std::set{0, 1, 2, 3, 4}));
}

// A checkerboard of black and white texels, each a little larger than a pixel.
TEST_F(RendererTexelsTest, AveragesTheTexelsUnderAPixel) {
  const ShaderMaterial checker(
      "ivec2 t = ivec2(floor(uv * 40.0)); return vec3(float((t.x + t.y) & 1));", 40, 40);
  Scene scene = plate_scene();
  const FrameInput input{{0, 0, 1}, {}, 0};
  const auto draw = [&](bool average) {
    const auto renderer = make(scene, checker, {.average_texels = average});
    renderer->draw(input);
    Image<Rgb32f> target(kWidth, kHeight);
    renderer->read_target(target.view());
    return target;
  };
  const Image<Rgb32f> nearest = draw(false);
  const Image<Rgb32f> averaged = draw(true);
  // The truth: 16 x 16 rays through each pixel. The pixel's sides on the plate are not quite the
  // texels' directions (the projector looks down a little), and the footprint is taken as their
  // box.
  constexpr int kRays = 16;
  double nearest_error = 0;
  double averaged_error = 0;
  int compared = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      double white = 0;
      bool inside = true;
      for (int i = 0; i < kRays * kRays; ++i) {
        const auto point =
            point_on_plate(input, x + (i % kRays + 0.5) / kRays, y + (i / kRays + 0.5) / kRays);
        inside = inside && point;
        if (!point) break;
        const int column = static_cast<int>(std::floor((point->x() / 0.2 + 0.5) * 40));
        const int row = static_cast<int>(std::floor((0.5 - point->y() / 0.2) * 40));
        white += ((column + row) & 1) / double(kRays * kRays);
      }
      if (!inside) continue;
      const auto shown = [&](const Image<Rgb32f>& image) {
        return (srgb_from_xyz() * image(x, y).cast<double>()).y();
      };
      nearest_error += std::abs(shown(nearest) - white);
      averaged_error += std::abs(shown(averaged) - white);
      ++compared;
    }
  }
  ASSERT_GT(compared, 500);
  EXPECT_GT(nearest_error / compared, 0.1) << "nothing to average";
  EXPECT_LT(averaged_error / compared, 0.02);
}

}  // namespace
}  // namespace veneer::render
