// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <string>

#include "render/gl_objects.h"

namespace veneer::render {

/// The complete source of the pass's fragment stage.
[[nodiscard]] std::string scanout_fragment_source();

/// Draws codes into a framebuffer of normalised channels, so that its memory holds exactly them:
/// `round(code (2^buffer_bits - 1) / (2^code_bits - 1))`. Row 0 of the raster becomes row 0 of the
/// framebuffer. Needs a current context, always the same.
class ScanoutPass {
 public:
  /// @param code_bits  of a code, at most 16.
  /// Errors: kUnavailable (the driver refuses a shader).
  [[nodiscard]] static Result<ScanoutPass> create(int code_bits);
  /// @param codes  RGBA16UI texture.
  /// @param framebuffer  of the same size, its first colour attachment of `buffer_bits` bits a
  /// channel, as many as the codes have or more, at most 14.
  void run(GLuint codes, GLuint framebuffer, int buffer_bits, int width, int height) const;

 private:
  ScanoutPass() = default;
  GlProgram program_;
  GlVertexArray no_vertices_;
  GLint buffer_maximum_location_ = -1;
};

}  // namespace veneer::render
