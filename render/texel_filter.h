// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <Eigen/Core>

#include <string>
#include <string_view>

#include "btf/material.h"

namespace veneer::render {

/// What a pixel shows of the texels under it (texels.glsl): of the level that suits the pixel's
/// size the texel at its centre, or the mean of up to two along each side.
struct TexelFilter {
  Eigen::Vector2i texels{1, 1};  ///< of the sample
  int mip_levels = 1;
  bool average = false;
};
[[nodiscard]] TexelFilter texel_filter(const btf::Material& material, bool average);

/// GLSL: defines RADIANCE(uv, view, light), what a pixel shows of the model's function `sample`.
/// It reads `vec2 uv_width` (surface.glsl) and stands behind the model.
[[nodiscard]] std::string radiance_source(std::string_view sample, const TexelFilter& filter);

}  // namespace veneer::render
