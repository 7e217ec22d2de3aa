// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <functional>
#include <vector>

#include "base/result.h"
#include "simulation/materials/height_field.h"

namespace veneer::simulation {

/// A rounded thing: all that is no further than `radius` from its core. The core is the line
/// between two points (a capsule; a sphere where they are one), a box with sides along the axes, or
/// a round disc. Lengths in tile widths; x along columns, y downwards, z up.
struct Body {
  enum class Core { kLine, kBox, kDisc };
  Core core = Core::kLine;
  /// An end of the line; the box's least corner; the disc's middle.
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  /// The other end; the box's greatest corner; the end of the disc's axis, as long as its radius.
  Eigen::Vector3d second = Eigen::Vector3d::Zero();
  double radius = 0.0;  ///< > 0

  /// The point of the core that is nearest.
  [[nodiscard]] Eigen::Vector3d nearest(const Eigen::Vector3d& place) const;
  /// Exact outside of the body; inside, no further from 0 than the true one.
  [[nodiscard]] double distance(const Eigen::Vector3d& place) const {
    return (place - nearest(place)).norm() - radius;
  }
  /// The least box with sides along the axes that holds it: two corners.
  [[nodiscard]] std::array<Eigen::Vector3d, 2> bounds() const;
};

[[nodiscard]] Body sphere(const Eigen::Vector3d& middle, double radius);
[[nodiscard]] Body capsule(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius);
/// A leaf. @param axis  at right angles to it, as long as its radius @param half_thickness  > 0
[[nodiscard]] Body disc(const Eigen::Vector3d& middle,
                        const Eigen::Vector3d& axis,
                        double half_thickness);
/// A bar without ends along x or y. @param across  where its middle line crosses the other axis
/// @param half_width, half_thickness  > radius, which rounds its edges
[[nodiscard]] Body endless_bar(bool along_x,
                               double across,
                               double height,
                               double half_width,
                               double half_thickness,
                               double radius);

/// A level ground at z = 0, which is the reference plane of the sample set, and bodies over it, in
/// it or hovering: a geometry with signed distances that no height field can hold. The tile
/// repeats; a body may reach across its edges.
struct BodyField {
  static constexpr int kGround = -1;

  int resolution = 0;           ///< cells a tile that lengths are told in (Geometry)
  double tile_width_mm = 10.0;  ///< > 0
  std::vector<Body> bodies;
  /// What a place is made of, on the body of this number or on kGround; repeats with the tile.
  std::function<Surface(const Eigen::Vector3d& place, int body)> surface_at;

  /// Errors: kInvalidOption (a size that is none, a NaN, a body without radius, or that reaches
  /// over more than 4 tile widths, endless bars apart).
  [[nodiscard]] Status check() const;
};

}  // namespace veneer::simulation
