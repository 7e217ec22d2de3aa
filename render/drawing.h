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
  /// Of the raster's sides: the targets are drawn on a raster this much smaller, and compensation
  /// interpolates between them. kLeastScale to 1.
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
