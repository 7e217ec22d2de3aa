// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "base/result.h"

namespace veneer::simulation {

/// How one point of a material reflects: a rough interface over a Lambertian body,
/// f_r = D G F / (4 cos_l cos_v) + (albedo / pi) (1 - F(theta_l)) (1 - F(theta_v)).
/// D and G are GGX with height-correlated masking, F is Schlick's (microfacet.h). What the
/// interface reflects does not reach the body, on the way in and on the way out: reciprocal, and
/// never more than what arrives.
struct Surface {
  Eigen::Vector3f albedo = Eigen::Vector3f::Constant(0.5F);  ///< of the body, RGB, each in [0, 1]
  /// Reflectance of the interface along its normal, RGB, each in [0, 1]: 0.04 for glass-like
  /// matter, tinted and large for metals, 0 for no interface at all.
  Eigen::Vector3f f0 = Eigen::Vector3f::Zero();
  float alpha = 0.3F;  ///< GGX roughness width, in [0.03, 1]
};

/// A periodic relief of square cells with what it is made of. Heights are at the cells' corners and
/// bilinear between them; a cell's surface is constant. Rows grow downwards as in an image, that is
/// towards -y of the local frame (btf/direction.h).
struct HeightField {
  int resolution = 0;           ///< cells along each side
  double tile_width_mm = 10.0;  ///< > 0
  /// [resolution x resolution], corner (column, row) at [row * resolution + column], in tile
  /// widths.
  std::vector<float> heights;
  std::vector<Surface> surfaces;  ///< [resolution x resolution], of the cell right below the corner

  /// Errors: kInvalidOption (sizes that do not match; a NaN; a value outside its range).
  [[nodiscard]] Status check() const;
};

/// How much finer than the texels a registered material's geometry is.
inline constexpr int kCellsPerTexel = 4;

/// A relief of `resolution` cells, all flat and of one surface.
[[nodiscard]] HeightField flat_field(int resolution, const Surface& surface);

}  // namespace veneer::simulation
