// SPDX-License-Identifier: Apache-2.0
#include "render/screen_error.h"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
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

int texel_along(double uv, int size) {
  return std::min(static_cast<int>((uv - std::floor(uv)) * size), size - 1);
}

bool is_near_edge(double uv, int size) {
  const double place = uv * size;
  return std::abs(place - std::round(place)) < kTexelEdge;
}

double encode(double linear) { return std::pow(std::clamp(linear, 0.0, 1.0), kEncodingExponent); }

Vector3d seen(const btf::InterpolatedSet& set, const ScreenQuery& query) {
  Vector3d sum = Vector3d::Zero();
  for (const auto& [texel, part] : query.shares)
    sum += part * set.radiance(texel, query.view, query.light);
  return sum;
}

}  // namespace

std::vector<ScreenQuery::Share> shares_of(const Eigen::Vector2d& uv,
                                          const Eigen::Vector2d& right,
                                          const Eigen::Vector2d& down,
                                          int width,
                                          int height,
                                          int rays) {
  std::map<int, int> hits;
  for (int j = 0; j < rays; ++j)
    for (int i = 0; i < rays; ++i) {
      const Eigen::Vector2d at =
          uv + ((i + 0.5) / rays - 0.5) * right + ((j + 0.5) / rays - 0.5) * down;
      ++hits[texel_along(at.y(), height) * width + texel_along(at.x(), width)];
    }
  std::vector<ScreenQuery::Share> shares;
  for (const auto& [texel, count] : hits)
    shares.push_back({texel, count / static_cast<double>(rays * rays)});
  return shares;
}

Result<std::vector<ScreenQuery>> probe_screen(const MeshBuffers& mesh,
                                              const DrawInput& input,
                                              const DirectionalLight& light,
                                              const Eigen::Vector2d& repeats,
                                              const calibration::ProjectorProfile& profile,
                                              const btf::SampleSetInfo& set,
                                              int wanted,
                                              int rays) {
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
  const auto row = static_cast<std::size_t>(width);
  const auto uv_of = [&shown](std::size_t i) -> Eigen::Vector2d { return shown[0][i].head<2>(); };
  const auto is_covered = [&shown](std::size_t i) { return shown[0][i] != Vector3d::Zero(); };
  for (std::size_t i = stride / 2; i < pixels; i += stride) {
    if (!is_covered(i)) continue;
    const Eigen::Vector2d uv = uv_of(i);
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    Eigen::Vector2d down = right;
    if (rays > 1) {
      if (i % row == 0 || i % row == row - 1 || i < row || i + row >= pixels) continue;
      if (!(is_covered(i - 1) && is_covered(i + 1) && is_covered(i - row) && is_covered(i + row)))
        continue;
      right = (uv_of(i + 1) - uv_of(i - 1)) / 2;
      down = (uv_of(i + row) - uv_of(i - row)) / 2;
    } else if (is_near_edge(uv.x(), set.width) || is_near_edge(uv.y(), set.height)) {
      continue;
    }
    const auto direction = [i](const std::vector<Vector3d>& colours) {
      return btf::Direction((2.0 * (colours[i].array() - 1.0)).matrix().normalized());
    };
    queries.push_back({static_cast<int>(i),
                       shares_of(uv, right, down, set.width, set.height, rays),
                       direction(shown[1]),
                       direction(shown[2])});
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
          values[i] = seen(set, queries[i]);
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
