// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "btf/direction.h"

namespace veneer::btf {

/// Which measured directions make up a value at another one. Weights are >= 0 and sum to 1; unused
/// entries have weight 0 and repeat a valid index. The value is scale * sum(weight * sample).
struct DirectionWeights {
  std::array<int, 3> index{};
  std::array<double, 3> weight{};
  double scale = 1.0;
};

/// What a direction is, which decides what happens outside the data.
enum class DirectionRole {
  kView,   ///< clamped to the data's border at its azimuth
  kLight,  ///< as the view, times cos(theta) / cos(theta of the border), never over 1; below the
           ///< horizon 0
};

/// Linear interpolation between scattered directions: barycentric on the spherical Delaunay
/// triangulation of the set (spherical_delaunay.h), which is the reference that everything drawn is
/// measured against. The weights are those with which sum(weight * direction) points along the
/// asked direction, so they are continuous across edges.
///
/// Outside the data the direction is first moved to the border of the triangulation: along its
/// azimuth where the normal lies inside the border, else to the nearest point of it (a one-sided
/// set has no border at every azimuth). A light's scale is then cos(theta) / cos(theta_border), at
/// most 1, with theta_border the interpolated theta of the border's two directions, or the border
/// point's own where that is larger, so that the scale is 1 on the border. Where the border is the
/// horizon, every light above it has scale 1 and the quotient is never formed.
///
/// Domain: any unit vector. Sets on one great circle, and sets of one or two directions, have no
/// triangle: all directions go to the nearest point of the arc through them. Directions lie in the
/// upper hemisphere; equal ones in a set are a bug of the caller (importers refuse them).
/// Thread-safe after construction.
class SphericalInterpolator {
 public:
  /// @param directions  at least one.
  SphericalInterpolator(const DirectionSet& directions, DirectionRole role);
  [[nodiscard]] DirectionWeights weights(const Direction& direction) const;
  /// The triangles, for pictures and tests.
  [[nodiscard]] const std::vector<std::array<int, 3>>& triangles() const { return triangles_; }

 private:
  struct BorderPoint {
    std::array<int, 2> index;
    std::array<double, 2> weight;
  };
  // Corners of a triangle as the rows of a matrix that gives unnormalised weights, and its
  // neighbour across the edge opposite each corner; -1 where there is none.
  struct Cell {
    Eigen::Matrix3d weights_from_direction;
    std::array<int, 3> neighbour;
  };
  struct Found {
    int triangle;  // holds the direction, or the border was crossed leaving it
    bool inside;
    Eigen::Vector3d weight;
  };

  void link_triangles();
  void find_border();
  void fill_hints();
  [[nodiscard]] Found walk(const Direction& direction, int start) const;
  [[nodiscard]] std::size_t hint_of(const Direction& direction) const;
  [[nodiscard]] BorderPoint border_at_azimuth(const Direction& direction) const;
  [[nodiscard]] BorderPoint nearest_on_border(const Direction& direction) const;
  [[nodiscard]] DirectionWeights outside(const Direction& direction) const;

  DirectionSet directions_;
  std::vector<double> thetas_;  // of each direction
  DirectionRole role_;
  std::vector<std::array<int, 3>> triangles_;
  std::vector<Cell> cells_;  // one for each triangle
  std::vector<std::array<int, 2>>
      border_;  // counter-clockwise; sorted by azimuth where around the normal
  std::vector<double> border_azimuth_;  // of the first direction of each edge; empty if not around
  std::vector<int> hints_;              // where to start walking, by stereographic position
};

}  // namespace veneer::btf
