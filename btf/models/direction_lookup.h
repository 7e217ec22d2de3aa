// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "btf/model_shader.h"
#include "btf/spherical_interpolation.h"

namespace veneer::btf {

/// SphericalInterpolator in a form that a shader can follow: the square of the elevated concentric
/// map is cut into kSide x kSide cells, each of which names a region; a region has three directions
/// and a matrix that turns any direction near it into their weights.
///
/// Weights are those of the triangle (or border edge) that holds the cell's centre, everywhere in
/// the cell. So where an edge crosses a cell they go on beyond it linearly, down to about -0.06 at
/// Bonn's ring spacing, and differ from the reference by at most that; elsewhere they are exact. A
/// light's scale beyond the border takes cos(theta_border) linear between the border's directions,
/// which is exact where these form a ring. This class is what both the shader and its
/// double-precision counterpart use. Thread-safe.
class DirectionLookup {
 public:
  static constexpr int kSide = 256;
  /// Texture fetches of one lookup.
  static constexpr int kFetches = 5;
  DirectionLookup(const DirectionSet& directions, DirectionRole role);

  /// What direction_lookup.glsl computes; a view's scale is 1. @param direction  unit, z >= 0.
  [[nodiscard]] DirectionWeights weights(const Direction& direction) const;
  /// The textures `NAMECells` and `NAMERegions`.
  void add_textures(const std::string& name, std::vector<ModelTexture>& textures) const;

 private:
  using Matrix = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  struct Region {
    std::array<int, 3> index;
    Matrix weights_from_direction = Matrix::Zero();  // unnormalised
    // Their weighted sum is cos(theta_border); 0 away from the border.
    Eigen::Vector3f border_cosines = Eigen::Vector3f::Zero();
  };
  void add_triangles(const DirectionSet& directions, const SphericalInterpolator& reference);
  [[nodiscard]] std::optional<Region> edge_region(const DirectionSet& directions,
                                                  const Direction& centre,
                                                  const DirectionWeights& exact) const;
  [[nodiscard]] Region fixed_region(const DirectionSet& directions,
                                    const Direction& centre,
                                    const DirectionWeights& exact) const;

  DirectionRole role_;
  std::vector<std::uint16_t> cells_;  // row by row; the first row is the smallest second coordinate
  std::vector<Region> regions_;
};

}  // namespace veneer::btf
