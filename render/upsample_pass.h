// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <string>

#include "base/result.h"
#include "render/draw_target.h"
#include "render/fade_mask.h"
#include "render/gl_objects.h"

namespace veneer::render {

/// @param has_part  draws one part of a fade alone; a program of its own.
[[nodiscard]] std::string upsample_fragment_source(bool has_part);

/// Brings what was drawn on a smaller raster onto the projector's: target and geometric factor
/// between the four nearest pixels, those counted that see the surface. A pixel is covered where
/// the nearest is. Needs a current context, always the same.
class UpsamplePass {
 public:
  /// Errors: kUnavailable (the driver refuses a shader).
  [[nodiscard]] static Result<UpsamplePass> create();
  /// Overwrites the colour of `to`.
  void run(const DrawTarget& from, const DrawTarget& to) const;
  /// The same on one part alone; the rest of `to` stays.
  void run(const DrawTarget& from, const DrawTarget& to, const FadePart& part) const;

 private:
  struct Program {
    GlProgram program;
    GLint pixels = -1;
    GLint fade = -1;
    GLint is_next = -1;
  };
  UpsamplePass() = default;
  [[nodiscard]] static Result<Program> link(bool has_part);
  void run(const Program& program, const DrawTarget& from, const DrawTarget& to) const;
  Program whole_;
  Program part_;
  GlVertexArray no_vertices_;
};

}  // namespace veneer::render
