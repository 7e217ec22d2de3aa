// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "btf/model_shader.h"
#include "btf/spherical_interpolation.h"

namespace veneer::btf {

/// SphericalInterpolator in a form that a shader can follow: the square of the elevated concentric
/// map is cut into kSide x kSide cells, each of which names a region; a region has three directions
/// and a matrix that turns any direction near it into their weights.
///
/// Weights are those of the triangle (or border edge) that holds the cell's centre, everywhere in
/// the cell, negative ones cut to 0. So they are exact but where an edge crosses a cell, where they
/// differ from the reference by at most 0.04 at Bonn's ring spacing. Scattered sets have triangles
/// thinner than two cells, mostly along their border; there, and beyond the border of a one-sided
/// set, a cell has the weights of its centre, rounded to a thousandth. Single weights may
/// then be any other part of 1, but the point that they stand for stays near the reference's:
/// within 0.05 for a real RTI dome, 0.25 at worst and 0.0003 in the mean for 200 random directions.
///
/// A light's scale beyond the border takes cos(theta_border) linear between the border's
/// directions, which is exact where these form a ring, and the border's least cosine in its
/// triangles. On scattered sets, whose border goes up and down, it may be off: for
/// the lights of that dome by 3e-5 in the mean, but by up to 0.31 at single directions. This class
/// is what both the shader and its double-precision counterpart use. Thread-safe.
class DirectionLookup {
 public:
  static constexpr int kSide = 256;
  /// Texture fetches of one lookup.
  static constexpr int kFetches = 5;
  /// Four RGBA texels: three times a row of the matrix from direction to unnormalised weights and
  /// the border's cosine, then the three directions' indices. The weighted sum of the cosines is
  /// cos(theta_border); they are 0 away from the border.
  using Region = std::array<float, 16>;
  DirectionLookup(const DirectionSet& directions, DirectionRole role);

  /// What direction_lookup.glsl computes; a view's scale is 1. @param direction  unit, z >= 0.
  [[nodiscard]] DirectionWeights weights(const Direction& direction) const;
  /// The textures `NAMECells` and `NAMERegions`.
  void add_textures(const std::string& name, std::vector<ModelTexture>& textures) const;

 private:
  struct Triangle {
    Eigen::Matrix3d weights;  // from a direction, unnormalised
    Eigen::Vector3d cosines;  // of the border, for lights in a triangle there
  };
  // By their corners, in the reference's order.
  [[nodiscard]] std::map<std::array<int, 3>, Triangle> find_triangles(
      const DirectionSet& directions, const SphericalInterpolator& reference) const;
  // The weights beyond the border in the cell around `centre`, where the reference is `exact`.
  [[nodiscard]] Region border_region(const DirectionSet& directions,
                                     const Direction& centre,
                                     const DirectionWeights& exact) const;

  DirectionRole role_;
  std::vector<std::uint16_t> cells_;  // row by row; the first row is the smallest second coordinate
  std::vector<Region> regions_;
};

}  // namespace veneer::btf
