// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <string>
#include <vector>

#include "btf/model_shader.h"
#include "calibration/profile.h"
#include "render/frame_block.h"
#include "render/gl_objects.h"
#include "render/mesh_buffers.h"
#include "render/model_textures.h"

namespace veneer::render {

/// The sources of the shells' programs for a model and a number of lights, complete and compilable.
[[nodiscard]] std::string shell_vertex_source(int light_count);
[[nodiscard]] std::string shell_fragment_source(const btf::ModelShader& shader, int light_count);
[[nodiscard]] std::string shell_under_fragment_source();

/// Draws the layers of a material as shells: the mesh with its vertices moved along their normals
/// by each layer's height (silhouettes as in Magda and Kriegman 2005, Figure 6). In the order in
/// which rays meet them, whatever the mesh: the nearest of all shells first, then what is behind
/// that, and so on until nothing is left (Everitt 2001, "Interactive Order-Independent
/// Transparency"). Shells are seen from outside only. Not for frames against a deadline. Needs a
/// current context, always the same.
class ShellPass {
 public:
  /// @param shader  with shells.   @param texel_m  what a height of 1 is on the object.
  /// @param geometry  of the pinhole that sees them, which stands where the eye is.
  /// Errors: kUnavailable.
  [[nodiscard]] static Result<ShellPass> create(const btf::ModelShader& shader,
                                                std::vector<Light> lights,
                                                const Eigen::Vector2d& texture_repeats,
                                                const calibration::ProjectorGeometry& geometry,
                                                double texel_m);
  void draw(const MeshBuffers& mesh, const DrawInput& input) const;
  /// Of the pinhole's size, RGBA32F: XYZ in cd/m^2, and what is hidden of the background.
  [[nodiscard]] GLuint framebuffer() const { return seen_framebuffer_.id(); }

 private:
  ShellPass(std::vector<Light> lights,
            const Eigen::Vector2d& texture_repeats,
            const calibration::ProjectorGeometry& geometry);
  [[nodiscard]] bool draw_next(const MeshBuffers& mesh, std::size_t turn) const;
  void add_beneath() const;

  std::vector<Light> lights_;
  Eigen::Vector2d texture_repeats_;
  calibration::ProjectorGeometry geometry_;
  std::vector<float> heights_m_;
  GlProgram program_;
  GlProgram under_program_;
  ModelTextures textures_;
  GLuint nearer_unit_ = 0;
  GLint layer_ = -1;  // uniforms of program_
  GLint height_ = -1;
  GlBuffer uniforms_;
  GlTexture nearest_;    // what one turn draws
  GlTexture depths_[2];  // of this turn and of the last
  GlFramebuffer nearest_framebuffers_[2];
  GlTexture seen_;  // all turns together
  GlFramebuffer seen_framebuffer_;
  GlVertexArray no_vertices_;
  GlQuery any_;
};

}  // namespace veneer::render
