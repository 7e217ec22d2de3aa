// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "base/mesh.h"
#include "base/result.h"

namespace veneer::render {

/// How large a texel of the sample is on an object: the side of a square of its area, metres.
/// Texture coordinates that stretch or shrink over the object make it differ from place to place.
struct TexelSize {
  double mean_m = 0;  ///< root of the object's area over its number of texels
  double low_m = 0;   ///< on a twentieth of the area texels are smaller
  double high_m = 0;  ///< on a twentieth of the area texels are larger
};

/// @param mesh  as the renderer draws it (check_drawable()).   @param texels  of the sample, > 0.
/// Triangles that span no area on the object or in texture space are left out.
/// Errors: kBadFormat (no triangle is left), kInvalidOption (texture_repeats of 0).
[[nodiscard]] Result<TexelSize> texel_size_on(const Mesh& mesh,
                                              const Eigen::Vector2d& texture_repeats,
                                              const Eigen::Vector2i& texels);

}  // namespace veneer::render
