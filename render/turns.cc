// SPDX-License-Identifier: Apache-2.0
#include "render/turns.h"

#include <algorithm>
#include <chrono>
#include <string_view>

#include "base/clock.h"
#include "base/random.h"
#include "base/statistics.h"

namespace veneer::render {
namespace {

constexpr int kWarmUpFrames = 2;
constexpr std::string_view kQueryClock = "GL timer query";
constexpr std::string_view kFinishClock = "steady clock around glFinish";

}  // namespace

DrawTarget::DrawTarget(int width, int height)
    : colour(make_texture_2d(GL_RGBA16F, width, height)),
      depth(make_texture_2d(GL_DEPTH_COMPONENT32F, width, height)),
      framebuffer(make_framebuffer()) {
  glNamedFramebufferTexture(framebuffer.id(), GL_COLOR_ATTACHMENT0, colour.id(), 0);
  glNamedFramebufferTexture(framebuffer.id(), GL_DEPTH_ATTACHMENT, depth.id(), 0);
}

btf::ModelShader plain_textures() {
  btf::ModelTexture texture;
  texture.sampler = "Albedo";
  texture.format = btf::TexelFormat::kRgba16f;
  texture.width = texture.height = kPlainTexels;
  texture.linear = true;
  Pcg32 random(1);
  for (int i = 0; i < 4 * kPlainTexels * kPlainTexels; ++i) {
    const Eigen::half value(static_cast<float>(random.uniform()));
    const auto* bytes = reinterpret_cast<const std::byte*>(&value);
    texture.data.insert(texture.data.end(), bytes, bytes + sizeof(value));
  }
  btf::ModelShader shader;
  shader.textures.push_back(std::move(texture));
  shader.fetches = 1;
  return shader;
}

RenderTiming timing_of(const std::string& name,
                       const btf::ModelShader& shader,
                       const DrawPass& pass) {
  RenderTiming timing;
  timing.name = name;
  timing.fetches = shader.fetches;
  timing.gpu_bytes = shader.gpu_bytes();
  if (const AngularCache* cache = pass.cache()) {
    timing.fetches = shader.cache->texel_fetches + shader.cache->layers;
    timing.gpu_bytes += cache->gpu_bytes();
  }
  if (const SurfaceBuffer* surface = pass.surface()) timing.gpu_bytes += surface->gpu_bytes();
  return timing;
}

Turns::Turns(const EglContext& context, std::size_t count)
    : context_(context), query_(make_query(GL_TIME_ELAPSED)), times_(count) {}

void Turns::run(int frames,
                const std::function<void(std::size_t which, int frame)>& work,
                Progress& progress) {
  progress.start("timing", frames);
  for (int frame = -kWarmUpFrames; frame < frames; ++frame) {
    for (std::size_t which = 0; which < times_.size(); ++which) {
      glFinish();
      const auto start = std::chrono::steady_clock::now();
      glBeginQuery(GL_TIME_ELAPSED, query_.id());
      work(which, frame);
      glEndQuery(GL_TIME_ELAPSED);
      glFinish();
      const Duration elapsed = std::chrono::steady_clock::now() - start;
      GLuint64 query_ns = 0;
      glGetQueryObjectui64v(query_.id(), GL_QUERY_RESULT, &query_ns);
      if (frame < 0) continue;
      times_[which].finish_ms.push_back(1e3 * to_seconds(elapsed));
      times_[which].query_ms.push_back(1e-6 * static_cast<double>(query_ns));
    }
    if (frame >= 0) progress.advance();
  }
  progress.finish();
}

// A query counts the GPU's work alone, so that it may be below the clock, by no more than the
// cost of issuing the commands; never above it. Software rasterisers have been seen to count only
// the part of a draw that runs on their worker threads.
bool Turns::queries_are_plausible() const {
  if (context_.is_software()) return false;
  return std::ranges::all_of(times_, [](const Times& times) {
    const double query = quantile(times.query_ms, 0.5);
    return query > 0.0 && query <= 1.05 * quantile(times.finish_ms, 0.5);
  });
}

void Turns::report(RenderBenchResult& result) const {
  VENEER_CHECK(result.timings.size() == times_.size());
  const bool use_queries = queries_are_plausible();
  result.renderer = context_.description();
  result.clock = use_queries ? kQueryClock : kFinishClock;
  for (std::size_t i = 0; i < times_.size(); ++i) {
    const std::vector<double>& ms = use_queries ? times_[i].query_ms : times_[i].finish_ms;
    RenderTiming& timing = result.timings[i];
    timing.ms_median = quantile(ms, 0.5);
    timing.ms_p95 = quantile(ms, 0.95);
    timing.ratio = timing.ms_median / result.timings.front().ms_median;
  }
}

}  // namespace veneer::render
