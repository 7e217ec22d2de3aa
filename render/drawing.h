// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/result.h"
#include "btf/material.h"
#include "render/angular_cache_options.h"
#include "render/evaluation.h"

namespace veneer::render {

/// How a material is drawn: all that may be traded for time without another fit.
struct DrawingOptions {
  AngularCacheOptions cache{};
  /// Each pixel shows the mean of the texels under it, up to two along each side, in place of the
  /// texel at its centre: four evaluations, and no jagged edges between texels. Of materials with
  /// mip levels either is done on the level that suits the pixel's size.
  bool average_texels = false;
  /// Compute goes without the angular cache.
  Evaluation evaluation = Evaluation::kFragment;
  /// Of the raster's sides: targets are drawn on a raster this much smaller, rounded up, and
  /// brought to the projector's by interpolating target and geometric factor between the four
  /// nearest pixels that see the surface; the nearest says whether there is any. Pixels are of the
  /// smaller raster where the cache counts them and texels are averaged. Compensation and counts
  /// are of the projector's pixels. kLeastScale to 1, which costs nothing.
  double scale = 1;
  static constexpr double kLeastScale = 0.25;
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

/// One of the ways in which a renderer can draw: a material and how it is drawn.
struct Level {
  const btf::Material* material = nullptr;  ///< borrowed until the renderer is made
  DrawingOptions drawing{};
};

}  // namespace veneer::render
