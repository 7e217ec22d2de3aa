// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "btf/model_shader.h"
#include "render/benchmark.h"
#include "render/draw_pass.h"
#include "render/egl_context.h"
#include "render/gl_objects.h"

namespace veneer::render {

/// Half floats with depth, as the renderer draws into.
struct DrawTarget {
  DrawTarget(int width, int height);
  GlTexture colour;
  GlTexture depth;
  GlFramebuffer framebuffer;
};

/// The yardstick's texture, "Albedo" of plain.frag, kPlainTexels along a side.
[[nodiscard]] btf::ModelShader plain_textures();
inline constexpr int kPlainTexels = 256;
/// What is known of a draw before it is timed: name, fetches and bytes.
[[nodiscard]] RenderTiming timing_of(const std::string& name,
                                     const btf::ModelShader& shader,
                                     const DrawPass& pass);

/// Times several things that take turns within every frame, so that a change in the machine's load
/// hits all alike.
class Turns {
 public:
  /// @param context  current; borrowed.
  Turns(const EglContext& context, std::size_t count);
  /// Two frames go first that are not timed, numbered -2 and -1.
  /// @param work  issues the GL commands of one of the `count` things for a frame.
  void run(int frames,
           const std::function<void(std::size_t which, int frame)>& work,
           Progress& progress);
  /// Fills what was measured into `result`, whose timings are those of the `count` things.
  void report(RenderBenchResult& result) const;

 private:
  struct Times {
    std::vector<double> query_ms;
    std::vector<double> finish_ms;
  };
  [[nodiscard]] bool queries_are_plausible() const;
  const EglContext& context_;
  GlQuery query_;
  std::vector<Times> times_;
};

}  // namespace veneer::render
