// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "btf/interpolated_set.h"
#include "btf/material.h"
#include "calibration/profile.h"
#include "render/angular_cache_options.h"
#include "render/drawing.h"
#include "render/evaluation.h"
#include "render/renderer.h"
#include "render/scene.h"

namespace veneer::render {

struct RenderBenchMaterial {
  std::string name;  ///< as it is reported, such as "texel-colours 3+1"
  std::shared_ptr<const btf::Material>
      material;  ///< shared: the caller may time it in several runs
  AngularCacheOptions cache{};
  bool average_texels = false;  ///< as RendererOptions has it
  Evaluation evaluation = Evaluation::kFragment;
  double scale = 1;  ///< as DrawingOptions has it; below 1, interpolation is part of the time
};

struct RenderBenchOptions {
  /// Pixels. 16 to 8192 each.
  int width = 1024;
  int height = 768;
  /// Timed draws of each material, after two that are not. 3 to 10000.
  int frames = 40;
  std::vector<RenderBenchMaterial> materials{};
  /// Of a pixel's side. 1/16 to 16.
  double texels_per_pixel = 1.0;
  /// What the materials were fitted on: what they draw is then compared with it, pixel by pixel.
  const btf::InterpolatedSet* reference = nullptr;
  /// Along each side of a pixel that is compared: 1 asks for the texel at its centre, more for the
  /// mean over the pixel. 1 to 32.
  int reference_rays = 1;
  [[nodiscard]] Status check() const;
};

/// What one draw of the whole frame costs.
struct RenderTiming {
  std::string name;
  double ms_median = 0;
  double ms_p95 = 0;
  double ratio = 0;           ///< of the medians, to "plain"
  int fetches = 0;            ///< texture fetches per pixel and light
  std::size_t gpu_bytes = 0;  ///< the cache or the surface's points included
  /// The part of the triangles that are drawn from the angular cache, the mean over viewpoints;
  /// none where it is not used.
  std::optional<double> served{};
  /// Of what is drawn against the full set at the pixels' own directions (ScreenError), encoded.
  std::optional<double> screen_epsilon{};
  std::optional<double> screen_rmse{};
};

struct RenderBenchResult {
  std::string renderer;  ///< GL renderer and version
  std::string clock;     ///< what measured: "GL timer query" or "steady clock around glFinish"
  std::vector<RenderTiming> timings;  ///< "plain" first, then the materials in order, then
                                      ///< "interpolation from WxH" for every smaller raster, then
                                      ///< "compensation" and "compensation with residual"
};

/// Times drawing a curved mesh that covers the whole frame, texels_per_pixel texels along a
/// pixel's side, one directional light, into half floats with depth. "plain" is the yardstick: the
/// same mesh, interpolants and target, one filtered fetch times the light's cosine. All draws take
/// turns within every frame, so that a change in the machine's load hits all alike. "compensation"
/// is the full-screen pass that follows a draw in the renderer (with its counters), once for a
/// profile without and once for one with a colour residual; no material's figure contains it.
/// "Interpolation" is what brings the target of a smaller raster onto the whole one. The
/// GL timer query is used where it is plausible, else glFinish and the clock. Errors:
/// kInvalidOption, kUnavailable (no GL 4.5).
[[nodiscard]] Result<RenderBenchResult> bench_render(const RenderBenchOptions& options,
                                                     Progress& progress);

/// One way to draw a scene, and how it is reported.
struct NamedLevel {
  std::string name;
  Level level;  ///< its material is borrowed for the call
};

/// Times drawing a scene's target at each level as the renderer does: its mesh, its lights, the
/// profile's raster, at the level's scale and interpolated up from it, into half floats with depth.
/// Compensation is not in it. "plain" is the yardstick: the same mesh on the
/// whole raster, one filtered fetch times the sum of the cosines of all the scene's lights, each
/// with what arrives of it. All take turns within every frame, and the frames go round the
/// viewpoints. Ratios are to the plain draw of the same call, so that levels can be timed in
/// batches. The clock is chosen as bench_render() does. `level`, `next_level`, `fade` and
/// `dither_seed` of the viewpoints are not read.
/// @param viewpoints  at least one.  @param frames  timed draws of each, after two that are not. 3
/// to 10000. Errors: kInvalidOption, kBadFormat (Renderer::create), kUnavailable (no GL 4.5, a
/// shader that the driver refuses).
[[nodiscard]] Result<RenderBenchResult> time_scene(const Scene& scene,
                                                   const calibration::ProjectorProfile& profile,
                                                   std::span<const FrameInput> viewpoints,
                                                   std::span<const NamedLevel> levels,
                                                   int frames,
                                                   Progress& progress);

}  // namespace veneer::render
