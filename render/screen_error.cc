// SPDX-License-Identifier: Apache-2.0
#include "render/screen_error.h"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/colour.h"
#include "base/parallel.h"

namespace veneer::render {
namespace {

using Eigen::Vector3d;

constexpr double kEncodingExponent = 1.0 / 2.2;  // of the literature's tables
// In texels: far above what interpolating texture coordinates in float may err.
constexpr double kTexelEdge = 0.02;

// Shown as colours, all positive.
constexpr std::array kProbes{
    "return vec3(uv + 1.0, 0.5);", "return 0.5 * view + 1.0;", "return 0.5 * light + 1.0;"};

double encode(double linear) { return std::pow(std::clamp(linear, 0.0, 1.0), kEncodingExponent); }

}  // namespace

Result<std::vector<ScreenQuery>> probe_screen(const MeshBuffers& mesh,
                                              const DrawInput& input,
                                              const DirectionalLight& light,
                                              const Eigen::Vector2d& repeats,
                                              const calibration::ProjectorProfile& profile,
                                              const btf::SampleSetInfo& set,
                                              int wanted) {
  const int width = profile.geometry.width;
  const int height = profile.geometry.height;
  const GlTexture target = make_texture_2d(GL_RGBA32F, width, height);
  const GlTexture depth = make_texture_2d(GL_DEPTH_COMPONENT32F, width, height);
  const GlFramebuffer framebuffer = make_framebuffer();
  glNamedFramebufferTexture(framebuffer.id(), GL_COLOR_ATTACHMENT0, target.id(), 0);
  glNamedFramebufferTexture(framebuffer.id(), GL_DEPTH_ATTACHMENT, depth.id(), 0);

  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const DirectionalLight unit{light.direction_to_light, Vector3d::Constant(std::numbers::pi)};
  const Eigen::Matrix3d rgb_from_xyz = srgb_from_xyz();
  std::array<std::vector<Vector3d>, kProbes.size()> shown;
  std::vector<Eigen::Vector4f> read(pixels);
  for (std::size_t i = 0; i < kProbes.size(); ++i) {
    btf::ModelShader shader;
    shader.source =
        fmt::format("vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {{ {} }}", kProbes[i]);
    VENEER_ASSIGN(const DrawPass pass, DrawPass::create(shader, {unit}, repeats, profile));
    pass.draw(framebuffer.id(), mesh, input);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer.id());
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    glPixelStorei(GL_PACK_ROW_LENGTH, 0);
    glReadPixels(0, 0, width, height, GL_RGBA, GL_FLOAT, read.data());
    for (const Eigen::Vector4f& pixel : read)
      shown[i].push_back(pixel[3] > 0.0F ? Vector3d(rgb_from_xyz * pixel.head<3>().cast<double>())
                                         : Vector3d::Zero());
  }

  std::vector<ScreenQuery> queries;
  const std::size_t stride = std::max<std::size_t>(pixels / static_cast<std::size_t>(wanted), 1);
  for (std::size_t i = stride / 2; i < pixels; i += stride) {
    if (shown[0][i] == Vector3d::Zero()) continue;
    const auto texel_along = [](double uv, int size, bool& edge) {
      const double place = (uv - std::floor(uv)) * size;
      edge |= std::abs(place - std::round(place)) < kTexelEdge;
      return std::min(static_cast<int>(place), size - 1);
    };
    bool edge = false;
    const int x = texel_along(shown[0][i].x(), set.width, edge);
    const int y = texel_along(shown[0][i].y(), set.height, edge);
    if (edge) continue;
    const auto direction = [i](const std::vector<Vector3d>& colours) {
      return btf::Direction((2.0 * (colours[i].array() - 1.0)).matrix().normalized());
    };
    queries.push_back(
        {static_cast<int>(i), y * set.width + x, direction(shown[1]), direction(shown[2])});
  }
  return queries;
}

double ScreenError::rmse() const {
  return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
}

std::vector<Vector3d> reference_at(const btf::InterpolatedSet& set,
                                   std::span<const ScreenQuery> queries) {
  std::vector<Vector3d> values(queries.size());
  parallel_for(
      static_cast<std::int64_t>(queries.size()), 64, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
          values[i] = set.radiance(queries[i].texel, queries[i].view, queries[i].light);
      });
  return values;
}

void add_error(std::span<const Eigen::Vector4f> target,
               std::span<const ScreenQuery> queries,
               std::span<const Vector3d> reference,
               const DirectionalLight& light,
               ScreenError& error) {
  const Eigen::Matrix3d rgb_from_xyz = srgb_from_xyz();
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Vector3d drawn =
        std::numbers::pi *
        (rgb_from_xyz * target[static_cast<std::size_t>(queries[i].pixel)].head<3>().cast<double>())
            .cwiseQuotient(light.illuminance_rgb);
    for (int c = 0; c < 3; ++c) {
      const double difference = encode(drawn[c]) - encode(reference[i][c]);
      error.sum += std::abs(difference);
      error.squares += difference * difference;
    }
    error.count += 3;
  }
}

}  // namespace veneer::render
