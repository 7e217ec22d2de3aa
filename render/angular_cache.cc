// SPDX-License-Identifier: Apache-2.0
#include "render/angular_cache.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "render/compensate_pass.h"
#include "render/draw_pass.h"

namespace veneer::render {
namespace {

constexpr int kGroupSide = 8;  // local size of cache_values.comp
constexpr int kChunk = 8;      // clusters of one invocation there
constexpr int kBytesPerValue = 8;

constexpr char kNodesFrag[] =
#include "render/shaders/cache_nodes.frag.inc"
    ;
constexpr char kCellsFrag[] =
#include "render/shaders/cache_cells.frag.inc"
    ;
constexpr char kSortComp[] =
#include "render/shaders/cache_sort.comp.inc"
    ;
constexpr char kValuesComp[] =
#include "render/shaders/cache_values.comp.inc"
    ;
constexpr char kCachedEigenGlsl[] =
#include "render/shaders/cached_eigen.glsl.inc"
    ;
constexpr char kDrawCachedFrag[] =
#include "render/shaders/draw_cached.frag.inc"
    ;

// One more on each side than the raster needs, so that triangles over its edge can be served.
int nodes_along(int pixels, int spacing) {
  return (pixels + spacing - 1) / spacing + 1 + 2 * kCacheMargin;
}

std::string place_constants(int spacing) {
  return fmt::format(
      "const float kSpacing = {}.0;\nconst float kMargin = {}.0;\n", spacing, kCacheMargin);
}

std::string cache_constants(const btf::EigenCache& cache) {
  return fmt::format(
      "const int kClusters = {};\nconst int kCacheLayers = {};\n", cache.clusters, cache.layers);
}

std::string most_turn_constant(double most_turn) {
  return fmt::format("const float kMostTurn = {:.9g};\n", most_turn);
}

}  // namespace

std::string cache_nodes_fragment_source(int light_count) {
  return surface_header(light_count) + kNodesFrag;
}

std::string cache_cells_fragment_source(int light_count, double most_turn) {
  return surface_header(light_count) + most_turn_constant(most_turn) + kCellsFrag;
}

std::string cache_sort_compute_source(int light_count,
                                      const CacheRaster& raster,
                                      double most_turn) {
  return surface_header(light_count) +
         fmt::format("const vec2 kPixels = vec2({}, {});\nconst vec2 kCells = vec2({}, {});\n",
                     raster.width,
                     raster.height,
                     nodes_along(raster.width, raster.spacing) - 1,
                     nodes_along(raster.height, raster.spacing) - 1) +
         place_constants(raster.spacing) + most_turn_constant(most_turn) + kSortComp;
}

std::string cache_values_compute_source(const btf::ModelShader& shader) {
  return "#version 450 core\n#define CACHE_NODES\n" + cache_constants(*shader.cache) +
         shader.source + kValuesComp;
}

std::string draw_cached_fragment_source(const btf::ModelShader& shader,
                                        int light_count,
                                        int spacing,
                                        const TexelFilter& filter) {
  return surface_header(light_count) + "#define CACHE_PIXELS\n" + cache_constants(*shader.cache) +
         fmt::format("const int kCacheLightLayers = {};\n",
                     shader.cache->clusters * shader.cache->layers) +
         place_constants(spacing) + kCachedEigenGlsl + shader.source +
         radiance_source("btf_radiance_cached(uv)", filter) + kDrawCachedFrag;
}

Result<AngularCache> AngularCache::create(const btf::ModelShader& shader,
                                          int light_count,
                                          const AngularCacheOptions& options,
                                          int width,
                                          int height) {
  VENEER_CHECK(shader.cache.has_value() && options.spacing > 0);
  const CacheRaster raster{width, height, options.spacing};
  AngularCache cache;
  cache.columns_ = nodes_along(width, options.spacing);
  cache.rows_ = nodes_along(height, options.spacing);
  cache.layers_ = light_count * shader.cache->clusters * shader.cache->layers;
  cache.directions_ = 1 + light_count;
  cache.groups_z_ = light_count * ((shader.cache->clusters + kChunk - 1) / kChunk);
  cache.first_unit_ = static_cast<GLuint>(shader.textures.size());
  cache.scale_x_ = static_cast<double>(width) / options.spacing;
  cache.scale_y_ = static_cast<double>(height) / options.spacing;
  GLint most_layers = 0;
  glGetIntegerv(GL_MAX_ARRAY_TEXTURE_LAYERS, &most_layers);
  if (cache.layers_ > most_layers)
    return fail(
        Errc::kUnavailable,
        "making the angular cache: {} lights, {} clusters and {} values take {} layers, and "
        "this GL allows {}; draw without the cache, or fit fewer clusters or components",
        light_count,
        shader.cache->clusters,
        4 * shader.cache->layers,
        cache.layers_,
        most_layers);
  VENEER_ASSIGN(
      cache.nodes_program_,
      link_program(
          {{GL_VERTEX_SHADER, "draw.vert", draw_vertex_source(light_count)},
           {GL_FRAGMENT_SHADER, "cache_nodes.frag", cache_nodes_fragment_source(light_count)}}));
  VENEER_ASSIGN(cache.cells_program_,
                link_program({{GL_VERTEX_SHADER, "fullscreen.vert", fullscreen_vertex_source()},
                              {GL_FRAGMENT_SHADER,
                               "cache_cells.frag",
                               cache_cells_fragment_source(light_count, options.most_turn)}}));
  VENEER_ASSIGN(
      cache.sort_program_,
      link_program({{GL_COMPUTE_SHADER,
                     "cache_sort.comp",
                     cache_sort_compute_source(light_count, raster, options.most_turn)}}));
  VENEER_ASSIGN(cache.values_program_,
                link_program({{GL_COMPUTE_SHADER,
                               "the model in cache_values.comp",
                               cache_values_compute_source(shader)}}));
  ModelTextures::assign_units(shader, cache.values_program_.id());
  glProgramUniform1i(cache.values_program_.id(),
                     glGetUniformLocation(cache.values_program_.id(), "NodeDirections"),
                     static_cast<GLint>(cache.first_unit_));

  cache.node_directions_ = make_texture(GL_TEXTURE_2D_ARRAY);
  glTextureStorage3D(
      cache.node_directions_.id(), 1, GL_RGBA32F, cache.columns_, cache.rows_, cache.directions_);
  cache.values_ = make_texture(GL_TEXTURE_2D_ARRAY);
  glTextureStorage3D(cache.values_.id(), 1, GL_RGBA16F, cache.columns_, cache.rows_, cache.layers_);
  for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER}) {
    glTextureParameteri(cache.node_directions_.id(), filter, GL_NEAREST);
    glTextureParameteri(cache.values_.id(), filter, GL_LINEAR);
  }
  for (const GLenum side : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
    glTextureParameteri(cache.values_.id(), side, GL_CLAMP_TO_EDGE);
  cache.node_depth_ = make_texture_2d(GL_DEPTH_COMPONENT32F, cache.columns_, cache.rows_);
  cache.cells_ = make_texture_2d(GL_R8UI, cache.columns_ - 1, cache.rows_ - 1);
  cache.nodes_framebuffer_ = make_framebuffer();
  std::array<GLenum, 1 + kMaxLights> attachments{};
  for (int i = 0; i < cache.directions_; ++i) {
    const GLenum attachment = GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(i);
    attachments[static_cast<std::size_t>(i)] = attachment;
    glNamedFramebufferTextureLayer(
        cache.nodes_framebuffer_.id(), attachment, cache.node_directions_.id(), 0, i);
  }
  glNamedFramebufferDrawBuffers(
      cache.nodes_framebuffer_.id(), cache.directions_, attachments.data());
  glNamedFramebufferTexture(
      cache.nodes_framebuffer_.id(), GL_DEPTH_ATTACHMENT, cache.node_depth_.id(), 0);
  cache.cells_framebuffer_ = make_framebuffer();
  glNamedFramebufferTexture(
      cache.cells_framebuffer_.id(), GL_COLOR_ATTACHMENT0, cache.cells_.id(), 0);
  cache.no_vertices_ = make_vertex_array();
  return cache;
}

Eigen::Matrix4d AngularCache::nodes_from_clip() const {
  // The raster's pixel X is node X / spacing + margin, whose centre lies half a node further.
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m(0, 0) = scale_x_ / columns_;
  m(0, 3) = (scale_x_ + 2.0 * kCacheMargin + 1.0) / columns_ - 1.0;
  m(1, 1) = scale_y_ / rows_;
  m(1, 3) = (scale_y_ + 2.0 * kCacheMargin + 1.0) / rows_ - 1.0;
  return m;
}

void AngularCache::fill(const MeshBuffers& mesh,
                        const ModelTextures& textures,
                        GLuint frame_block,
                        GLuint nodes_frame_block) const {
  glDisable(GL_BLEND);
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);

  glBindFramebuffer(GL_FRAMEBUFFER, nodes_framebuffer_.id());
  glViewport(0, 0, columns_, rows_);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glClearDepth(0.0);
  glClearColor(0.0F, 0.0F, 0.0F, 0.0F);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  glUseProgram(nodes_program_.id());
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, nodes_frame_block);
  mesh.draw();
  glDisable(GL_DEPTH_TEST);

  glBindFramebuffer(GL_FRAMEBUFFER, cells_framebuffer_.id());
  glViewport(0, 0, columns_ - 1, rows_ - 1);
  glBindTextureUnit(0, node_directions_.id());
  glUseProgram(cells_program_.id());
  glBindVertexArray(no_vertices_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glUseProgram(sort_program_.id());
  glBindTextureUnit(1, cells_.id());
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, frame_block);
  mesh.sort();

  glUseProgram(values_program_.id());
  textures.bind();
  glBindTextureUnit(first_unit_, node_directions_.id());
  glBindImageTexture(0, values_.id(), 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RGBA16F);
  const auto groups = [](int nodes) {
    return static_cast<GLuint>((nodes + kGroupSide - 1) / kGroupSide);
  };
  glDispatchCompute(groups(columns_), groups(rows_), static_cast<GLuint>(groups_z_));
  glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
  glEnable(GL_DEPTH_TEST);
}

void AngularCache::bind() const { glBindTextureUnit(first_unit_, values_.id()); }

void AngularCache::assign(GLuint program) const {
  glProgramUniform1i(
      program, glGetUniformLocation(program, "CacheValues"), static_cast<GLint>(first_unit_));
}

std::size_t AngularCache::gpu_bytes() const {
  return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) *
         static_cast<std::size_t>(layers_) * kBytesPerValue;
}

}  // namespace veneer::render
