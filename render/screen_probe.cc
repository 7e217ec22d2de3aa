// SPDX-License-Identifier: Apache-2.0
#include "render/screen_probe.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "base/parallel.h"
#include "render/egl_context.h"
#include "render/scene_check.h"
#include "render/screen_error.h"

namespace veneer::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

// In texels: far above what interpolating texture coordinates in float may err.
constexpr double kTexelEdge = 0.02;
// A neighbour is on the same part of the surface where its uv is where the pixel's own steps lead
// to, within this part of a step. Steps change along a surface by a few per cent from pixel to
// pixel; a seam or another part is many of them away.
constexpr double kSameSurface = 0.5;
constexpr double kGoldenFraction = 0.6180339887498949;

int texel_along(double uv, int size) {
  return std::min(static_cast<int>((uv - std::floor(uv)) * size), size - 1);
}

bool is_near_edge(double uv, int size) {
  const double place = uv * size;
  return std::abs(place - std::round(place)) < kTexelEdge;
}

// The attachments of probe.frag, read back.
class ProbedRaster {
 public:
  ProbedRaster(int width, int height, std::size_t light_count)
      : width_(width), height_(height), values_(kLights + light_count) {
    depth_ = make_texture_2d(GL_DEPTH_COMPONENT32F, width, height);
    framebuffer_ = make_framebuffer();
    glNamedFramebufferTexture(framebuffer_.id(), GL_DEPTH_ATTACHMENT, depth_.id(), 0);
    std::vector<GLenum> buffers;
    for (std::size_t i = 0; i < values_.size(); ++i) {
      buffers.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(i));
      textures_.push_back(make_texture_2d(GL_RGBA32F, width, height));
      glNamedFramebufferTexture(framebuffer_.id(), buffers.back(), textures_.back().id(), 0);
      values_[i].resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    }
    glNamedFramebufferDrawBuffers(
        framebuffer_.id(), static_cast<GLsizei>(buffers.size()), buffers.data());
  }

  [[nodiscard]] GLuint framebuffer() const { return framebuffer_.id(); }

  void read_back() {
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer_.id());
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    glPixelStorei(GL_PACK_ROW_LENGTH, 0);
    for (std::size_t i = 0; i < values_.size(); ++i) {
      glReadBuffer(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(i));
      glReadPixels(0, 0, width_, height_, GL_RGBA, GL_FLOAT, values_[i].data());
    }
  }

  [[nodiscard]] std::size_t size() const { return values_[0].size(); }
  // Faces that are turned away from the projector are drawn, and get none of its light.
  [[nodiscard]] bool is_covered(std::size_t i) const {
    return values_[kPlace][i].z() > 0.0F && values_[kPlace][i].w() > 0.0F;
  }
  [[nodiscard]] Vector2d uv(std::size_t i) const {
    return values_[kPlace][i].head<2>().cast<double>();
  }
  [[nodiscard]] double geometry(std::size_t i) const { return values_[kPlace][i].w(); }
  [[nodiscard]] Vector2d right(std::size_t i) const {
    return values_[kSteps][i].head<2>().cast<double>();
  }
  [[nodiscard]] Vector2d down(std::size_t i) const {
    return values_[kSteps][i].tail<2>().cast<double>();
  }
  [[nodiscard]] Vector3d eye(std::size_t i) const {
    return values_[kEye][i].head<3>().cast<double>();
  }
  [[nodiscard]] Vector4d light(std::size_t i, std::size_t light) const {
    return values_[kLights + light][i].cast<double>();
  }

  [[nodiscard]] bool is_sound(std::size_t i) const {
    return std::ranges::all_of(values_, [i](const auto& value) { return value[i].allFinite(); });
  }
  // Whether all neighbours show the same part of the surface.
  [[nodiscard]] bool is_inside(std::size_t i) const {
    const auto row = static_cast<std::size_t>(width_);
    if (i % row == 0 || i % row == row - 1 || i < row || i + row >= size()) return false;
    const double tolerance = kSameSurface * std::max(right(i).norm(), down(i).norm());
    const auto continues = [&](std::size_t next, const Vector2d& step) {
      return is_covered(next) && (uv(next) - uv(i) - step).norm() <= tolerance;
    };
    return continues(i + 1, right(i)) && continues(i - 1, -right(i)) &&
           continues(i + row, down(i)) && continues(i - row, -down(i));
  }

 private:
  static constexpr std::size_t kPlace = 0;
  static constexpr std::size_t kSteps = 1;
  static constexpr std::size_t kEye = 2;
  static constexpr std::size_t kLights = 3;
  int width_;
  int height_;
  GlTexture depth_;
  std::vector<GlTexture> textures_;
  GlFramebuffer framebuffer_;
  std::vector<std::vector<Eigen::Vector4f>> values_;  // of each attachment
};

Vector3d sent_by_white(const Light& light, double arriving) {
  const Vector3d rgb = std::visit(
      [](const auto& l) -> Vector3d {
        if constexpr (std::is_same_v<std::decay_t<decltype(l)>, PointLight>)
          return l.intensity_rgb;
        else
          return l.illuminance_rgb;
      },
      light);
  return arriving / std::numbers::pi * rgb;
}

// One of each stratum of the covered pixels, at a place in it that no row or column repeats.
std::vector<std::size_t> spread_over(const std::vector<std::size_t>& covered, int wanted) {
  if (covered.size() <= static_cast<std::size_t>(wanted)) return covered;
  std::vector<std::size_t> chosen;
  const double stratum = static_cast<double>(covered.size()) / wanted;
  for (int i = 0; i < wanted; ++i) {
    const double within = (i + 1) * kGoldenFraction;
    const double at = (i + within - std::floor(within)) * stratum;
    chosen.push_back(covered[std::min(static_cast<std::size_t>(at), covered.size() - 1)]);
  }
  return chosen;
}

Vector3d sent(const btf::InterpolatedSet& set, const ScreenQuery& query) {
  Vector3d rgb = Vector3d::Zero();
  for (const ScreenQuery::Arriving& light : query.lights) {
    const btf::InterpolatedSet::PairWeights weights = set.weights(query.view, light.direction);
    Vector3d sample = Vector3d::Zero();
    for (const auto& [texel, part] : query.shares) sample += part * set.radiance(texel, weights);
    rgb += sample.cwiseProduct(light.rgb);
  }
  return rgb;
}

}  // namespace

std::vector<ScreenQuery::Share> shares_of(const Vector2d& uv,
                                          const Vector2d& right,
                                          const Vector2d& down,
                                          int width,
                                          int height,
                                          int rays) {
  std::map<int, int> hits;
  for (int j = 0; j < rays; ++j)
    for (int i = 0; i < rays; ++i) {
      const Vector2d at = uv + ((i + 0.5) / rays - 0.5) * right + ((j + 0.5) / rays - 0.5) * down;
      ++hits[texel_along(at.y(), height) * width + texel_along(at.x(), width)];
    }
  std::vector<ScreenQuery::Share> shares;
  for (const auto& [texel, count] : hits)
    shares.push_back({texel, count / static_cast<double>(rays * rays)});
  return shares;
}

Result<ProbedScreen> probe_screen(const MeshBuffers& mesh,
                                  const DrawInput& input,
                                  std::span<const Light> lights,
                                  const Vector2d& repeats,
                                  const calibration::ProjectorProfile& profile,
                                  const ScreenProbeOptions& options) {
  VENEER_ASSIGN(const DrawPass pass,
                DrawPass::create_probe({lights.begin(), lights.end()}, repeats, profile));
  ProbedRaster raster(profile.geometry.width, profile.geometry.height, lights.size());
  pass.draw(raster.framebuffer(), mesh, input);
  raster.read_back();

  std::vector<std::size_t> covered;
  for (std::size_t i = 0; i < raster.size(); ++i)
    if (raster.is_covered(i)) covered.push_back(i);
  ProbedScreen probed;
  probed.covered = static_cast<std::int64_t>(covered.size());
  for (const std::size_t i : spread_over(covered, options.pixels)) {
    if (!raster.is_sound(i)) {
      ++probed.unsound;
      continue;
    }
    const Vector2d uv = raster.uv(i);
    const bool is_at_edge = options.rays > 1 ? !raster.is_inside(i)
                                             : is_near_edge(uv.x(), options.width) ||
                                                   is_near_edge(uv.y(), options.height);
    if (is_at_edge) {
      ++probed.at_edges;
      continue;
    }
    ScreenQuery query;
    query.pixel = static_cast<int>(i);
    query.geometry = raster.geometry(i);
    query.shares =
        shares_of(uv, raster.right(i), raster.down(i), options.width, options.height, options.rays);
    query.view = raster.eye(i).normalized();
    for (std::size_t l = 0; l < lights.size(); ++l) {
      const Vector4d light = raster.light(i, l);
      query.lights.push_back({light.head<3>().normalized(), sent_by_white(lights[l], light.w())});
    }
    probed.queries.push_back(std::move(query));
  }
  return probed;
}

Result<std::vector<ProbedScreen>> probe_scene(const Scene& scene,
                                              const calibration::ProjectorProfile& profile,
                                              std::span<const FrameInput> viewpoints,
                                              const ScreenProbeOptions& options) {
  VENEER_TRY(check_drawable(scene));
  if (std::min({options.width, options.height, options.pixels, options.rays}) < 1)
    return fail(Errc::kInvalidOption,
                "probing the screen: {} x {} texels, {} pixels and {} rays; each must be 1 or more",
                options.width,
                options.height,
                options.pixels,
                options.rays);
  VENEER_ASSIGN(const EglContext context, EglContext::create());
  const MeshBuffers mesh(scene.mesh);
  std::vector<ProbedScreen> screens;
  for (const FrameInput& viewpoint : viewpoints) {
    VENEER_ASSIGN(ProbedScreen screen,
                  probe_screen(mesh,
                               {viewpoint.eye_in_world, viewpoint.world_from_object},
                               scene.lights,
                               scene.texture_repeats,
                               profile,
                               options));
    screens.push_back(std::move(screen));
  }
  return screens;
}

std::vector<Vector3d> reference_at(const btf::InterpolatedSet& set,
                                   std::span<const ScreenQuery> queries) {
  std::vector<Vector3d> values(queries.size());
  parallel_for(
      static_cast<std::int64_t>(queries.size()), 64, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
          values[i] = sent(set, queries[i]);
      });
  return values;
}

}  // namespace veneer::render
