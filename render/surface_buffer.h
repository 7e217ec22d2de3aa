// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <cstddef>
#include <string>

#include "render/gl_objects.h"
#include "render/texel_filter.h"

namespace veneer::render {

/// Defines what the compute shader reads back of a pixel: shaders/surface_words.glsl.
[[nodiscard]] std::string store_surface_fragment_source(int light_count);
/// Evaluates a model at every covered pixel; complete and compilable.
[[nodiscard]] std::string draw_compute_source(const std::string& model_source,
                                              int light_count,
                                              const TexelFilter& filter = {});

/// The place on the surface that each pixel of the raster sees, 32 bytes and depth, for evaluating
/// a material in a compute pass: positions and texture coordinates as floats, directions to
/// 5e-5 radians. Needs a current context, always the same.
class SurfaceBuffer {
 public:
  /// Errors: kUnavailable (this GL cannot draw to it, or the driver refuses the shader).
  [[nodiscard]] static Result<SurfaceBuffer> create(int light_count, int width, int height);
  /// Clears it and makes it and its program what is drawn to and with.
  void begin() const;
  [[nodiscard]] GLuint program() const { return program_.id(); }
  /// Tells a program of draw_compute_source() that its samplers are at `first_unit` and behind.
  void assign(GLuint program, GLuint first_unit);
  /// Runs it, which must be in use, for every pixel; the result goes to the colour attachment of
  /// `framebuffer`.
  /// @param masked  whether begin() was followed by a FadeMask, of which only the part is written.
  void evaluate(GLuint framebuffer, bool masked) const;
  [[nodiscard]] std::size_t gpu_bytes() const;

 private:
  SurfaceBuffer(int width, int height);
  int width_;
  int height_;
  GLuint first_unit_ = 0;
  GLint nearest_ = -1;
  GlTexture places_;
  GlTexture frames_;
  GlTexture depth_;
  GlFramebuffer framebuffer_;
  GlProgram program_;
};

}  // namespace veneer::render
