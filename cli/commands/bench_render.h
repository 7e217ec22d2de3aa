// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/command_line.h"
#include "render/angular_cache_options.h"
#include "render/evaluation.h"

namespace veneer::cli {

struct BenchRenderOptions {
  std::string size = "1024x768";  ///< pixels
  int frames = 40;
  /// What is timed; a fixed list of models where it is empty.
  std::vector<std::filesystem::path> materials;
  /// What the list is fitted to and everything drawn is compared with; a small synthetic cloth, and
  /// no comparison, where it is empty.
  std::filesystem::path set;
  double texels_per_pixel = 1.0;
  int rays = 1;          ///< of the reference, along a pixel's side
  bool average = false;  ///< times everything with averaged texels too
  /// kCompute times everything evaluated in a compute pass too.
  render::Evaluation evaluation = render::Evaluation::kFragment;
  double scale = 1;  ///< below 1, times everything on a raster this much smaller too
  /// With a spacing, whatever offers a cache is timed with it too.
  render::AngularCacheOptions cache;
};

/// Times what drawing a frame costs with each model, all draws taking turns, and prints it.
/// Errors: kInvalidOption, those of opening and fitting, kUnavailable (no GL).
[[nodiscard]] Result<int> bench_render(const BenchRenderOptions& options, CommandLine& line);

}  // namespace veneer::cli
