// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <Eigen/Core>

#include <cstddef>
#include <string>

#include "btf/model_shader.h"
#include "render/angular_cache_options.h"
#include "render/gl_objects.h"
#include "render/mesh_buffers.h"
#include "render/model_textures.h"
#include "render/texel_filter.h"

namespace veneer::render {

/// Nodes beyond each edge of the raster.
inline constexpr int kCacheMargin = 1;

/// The projector's raster and the pixels between nodes.
struct CacheRaster {
  int width;
  int height;
  int spacing;
};

/// The sources of its programs, complete and compilable.
[[nodiscard]] std::string cache_nodes_fragment_source(int light_count);
[[nodiscard]] std::string cache_cells_fragment_source(int light_count, double most_turn);
[[nodiscard]] std::string cache_sort_compute_source(int light_count,
                                                    const CacheRaster& raster,
                                                    double most_turn);
[[nodiscard]] std::string cache_values_compute_source(const btf::ModelShader& shader);
/// draw.frag's stand-in where the cache serves.
[[nodiscard]] std::string draw_cached_fragment_source(const btf::ModelShader& shader,
                                                      int light_count,
                                                      int spacing,
                                                      const TexelFilter& filter = {});

/// What depends on directions alone in a clustered model, evaluated at nodes every few pixels and
/// interpolated between them by the texture units. Node (i, j) lies at the corner (i, j) * spacing
/// of the raster's pixels.
///
/// Directions in the local frame change slowly over a smooth surface, texels from pixel to pixel;
/// so the error is that of linear interpolation over the turn between two nodes, which is bounded:
/// a cell serves only where its four nodes see the surface and no direction turns by more than
/// most_turn between them, and a triangle is drawn from the cache only where all cells under it
/// serve and the nodes tell the directions of its vertices. The others (silhouettes, seams of the
/// tangents, tight curvature, triangles over the edge of the raster or over very many cells) are
/// drawn per pixel. So a mesh of few large triangles gains nothing: tessellate it. Needs a current
/// context, always the same.
class AngularCache {
 public:
  /// @param shader  with a cache.
  /// Errors: kUnavailable (the driver refuses a shader, too many layers).
  [[nodiscard]] static Result<AngularCache> create(const btf::ModelShader& shader,
                                                   int light_count,
                                                   const AngularCacheOptions& options,
                                                   int width,
                                                   int height);
  /// Turns the raster's clip coordinates into the nodes'.
  [[nodiscard]] Eigen::Matrix4d nodes_from_clip() const;
  /// Evaluates the nodes and sorts the mesh's triangles (MeshBuffers::draw_sorted). Uniform buffers
  /// hold the block Frame, once with clip_from_object and once with nodes_from_clip() before it.
  /// Changes framebuffer, viewport, program and bindings; leaves depth testing on.
  void fill(const MeshBuffers& mesh,
            const ModelTextures& textures,
            GLuint frame_block,
            GLuint nodes_frame_block) const;
  /// Binds what draw_cached.frag reads, after the textures of the model.
  void bind() const;
  /// Tells a program that draws from the cache which units those are.
  void assign(GLuint program) const;
  [[nodiscard]] std::size_t gpu_bytes() const;

 private:
  int columns_ = 0;  // of nodes
  int rows_ = 0;
  int layers_ = 0;      // of values
  int directions_ = 0;  // a view and lights
  int groups_z_ = 0;
  GLuint first_unit_ = 0;
  double scale_x_ = 0;  // columns of nodes over the raster
  double scale_y_ = 0;
  GlProgram nodes_program_;
  GlProgram cells_program_;
  GlProgram sort_program_;
  GlProgram values_program_;
  GlTexture node_directions_;
  GlTexture node_depth_;
  GlTexture cells_;
  GlTexture values_;
  GlFramebuffer nodes_framebuffer_;
  GlFramebuffer cells_framebuffer_;
  GlVertexArray no_vertices_;
};

}  // namespace veneer::render
