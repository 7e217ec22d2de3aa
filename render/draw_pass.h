// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/rigid_transform.h"
#include "btf/model_shader.h"
#include "calibration/profile.h"
#include "render/angular_cache.h"
#include "render/draw_target.h"
#include "render/evaluation.h"
#include "render/fade_mask.h"
#include "render/frame_block.h"
#include "render/gl_objects.h"
#include "render/mesh_buffers.h"
#include "render/model_textures.h"
#include "render/scene.h"
#include "render/surface_buffer.h"
#include "render/texel_filter.h"

namespace veneer::render {

struct DrawOptions {
  AngularCacheOptions cache{};
  TexelFilter filter{};
  Evaluation evaluation = Evaluation::kFragment;
  double scale = 1;  ///< of the raster that is drawn on (scaled_raster()); the picture is the same
};

/// Clip coordinates from the projector's frame. Row 0 of the framebuffer is the first row of the
/// raster, so that nothing needs flipping and gl_FragCoord is the projector's pixel coordinate.
/// Depth is near / z in [0, 1], larger is nearer: a float keeps its precision at any distance.
[[nodiscard]] Eigen::Matrix4d clip_from_projector(const calibration::ProjectorGeometry& geometry);
/// Nothing nearer than this is drawn; no projector is in focus there.
inline constexpr double kNearPlane = 0.01;  // metres

/// The sources of the draw program for a model and a number of lights, complete and compilable.
/// Of shells the vertex program moves the mesh along its normals by `uniform float shell_height`.
enum class Surfaces { kMesh, kShells };
[[nodiscard]] std::string draw_vertex_source(int light_count, Surfaces surfaces = Surfaces::kMesh);
/// What fragment shaders of the surface begin with: version, uniforms and surface.glsl.
[[nodiscard]] std::string surface_header(int light_count);
[[nodiscard]] std::string draw_fragment_source(const std::string& model_source,
                                               int light_count,
                                               const TexelFilter& filter = {});
/// The same for the benchmark's yardstick, plain.frag, which reads the texture "Albedo".
/// @param point_lights  whether any of them is one.
[[nodiscard]] std::string plain_fragment_source(int light_count, bool point_lights);
/// The same for reading back what each pixel asks, probe.frag.
[[nodiscard]] std::string probe_fragment_source(int light_count);

/// Draws a mesh in a material, as the projector sees it, into an RGBA16F target with depth: XYZ in
/// cd/m^2 and the geometric factor (surface.glsl). Needs a current context, always the same.
class DrawPass {
 public:
  /// Shared by all passes that draw one material.
  using Textures = std::shared_ptr<const ModelTextures>;
  /// @param textures  of another pass with the same shader; null: uploads them.
  /// Errors: kUnavailable (the driver refuses the shader, a texture is too large), kInvalidOption
  /// (the angular cache with evaluation in a compute pass).
  [[nodiscard]] static Result<DrawPass> create(const btf::ModelShader& shader,
                                               std::vector<Light> lights,
                                               const Eigen::Vector2d& texture_repeats,
                                               const calibration::ProjectorProfile& profile,
                                               const DrawOptions& options = {},
                                               Textures textures = nullptr);
  /// The yardstick of the benchmark; `textures` holds "Albedo".
  [[nodiscard]] static Result<DrawPass> create_plain(const btf::ModelShader& textures,
                                                     std::vector<Light> lights,
                                                     const Eigen::Vector2d& texture_repeats,
                                                     const calibration::ProjectorProfile& profile);
  /// What each pixel asks, into as many colour attachments as probe.frag has outputs.
  [[nodiscard]] static Result<DrawPass> create_probe(std::vector<Light> lights,
                                                     const Eigen::Vector2d& texture_repeats,
                                                     const calibration::ProjectorProfile& profile);
  /// From the next draw on, where another profile says that the projector stands; its raster is the
  /// same (checked).
  void set_projector(const calibration::ProjectorProfile& profile);
  /// Clears the framebuffer and draws. Sets all GL state that it needs. Evaluated in a compute
  /// pass, only its colour is written, and its depth stays as it was.
  /// @param framebuffer  of the size raster().
  void draw(GLuint framebuffer, const MeshBuffers& mesh, const DrawInput& input) const;
  /// Draws one part of a fade, without clearing the colour. The angular cache is filled whole.
  void draw(GLuint framebuffer,
            const MeshBuffers& mesh,
            const DrawInput& input,
            const DrawMask& mask) const;
  /// Clears the framebuffer alone: a frame in which nothing is covered.
  void clear(GLuint framebuffer) const;
  [[nodiscard]] const Eigen::Vector2i& raster() const { return raster_; }
  [[nodiscard]] const Textures& textures() const { return textures_; }
  /// Null where every pixel is drawn by itself.
  [[nodiscard]] const AngularCache* cache() const { return cache_ ? &*cache_ : nullptr; }
  /// Null where fragments are evaluated as they are drawn.
  [[nodiscard]] const SurfaceBuffer* surface() const { return surface_ ? &*surface_ : nullptr; }

 private:
  DrawPass(std::vector<Light> lights,
           const Eigen::Vector2d& texture_repeats,
           const calibration::ProjectorProfile& profile,
           double scale = 1);
  [[nodiscard]] Status link(const std::string& fragment_source, const btf::ModelShader& textures);
  [[nodiscard]] Status provide(const btf::ModelShader& textures);
  [[nodiscard]] Status link_compute(const btf::ModelShader& shader, const DrawOptions& options);
  [[nodiscard]] Status add_cache(const btf::ModelShader& shader, const DrawOptions& options);
  void draw(GLuint framebuffer,
            const MeshBuffers& mesh,
            const DrawInput& input,
            const DrawMask* mask) const;
  void use(GLuint program) const;
  GlProgram program_;
  Textures textures_;
  GlBuffer uniforms_;
  std::optional<SurfaceBuffer> surface_;  // where program_ is a compute program
  // The cache, the program that draws from it, and the uniforms with which its nodes are drawn.
  std::optional<AngularCache> cache_;
  GlProgram cached_program_;
  GlBuffer node_uniforms_;
  std::vector<Light> lights_;
  Eigen::Vector2d texture_repeats_;
  Eigen::Matrix4d clip_from_world_;
  Eigen::Vector3d projector_in_world_;
  double reference_distance_m_ = 0;
  Eigen::Vector2i projector_raster_;
  Eigen::Vector2i raster_;  // that is drawn on
};

}  // namespace veneer::render
