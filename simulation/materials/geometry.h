// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>

#include "btf/direction.h"
#include "simulation/materials/height_field.h"

namespace veneer::simulation {

/// A direction of the local frame in the grid frame, whose y follows the rows downwards. The grid
/// frame is left-handed; nothing in an isotropic reflection notices.
[[nodiscard]] inline Eigen::Vector3d grid_from_local(const btf::Direction& direction) {
  return {direction.x(), -direction.y(), direction.z()};
}

/// What paths are traced through: a tile that repeats in x and y. Lengths in cells, of which a tile
/// has resolution() along each side; z is 0 on the reference plane of the sample set. Immutable, so
/// thread-safe.
class Geometry {
 public:
  /// Where a ray meets it. (u, v) in [0, 1]^2 is the place within the cell.
  struct Hit {
    int column{};
    int row{};
    double u{};
    double v{};
    double z{};
  };

  virtual ~Geometry() = default;
  [[nodiscard]] virtual int resolution() const = 0;
  /// Nothing is higher.
  [[nodiscard]] virtual double top() const = 0;
  /// The first point at or after `from` that the ray meets, or none where it leaves upwards, or
  /// runs level for many tiles.
  /// @param from  any place of the periodic plane; one inside of matter is a hit at once.
  /// @param direction  of unit length, grid frame
  [[nodiscard]] virtual std::optional<Hit> first_hit(const Eigen::Vector3d& from,
                                                     const Eigen::Vector3d& direction) const = 0;
  /// Unit, grid frame, away from matter.
  [[nodiscard]] virtual Eigen::Vector3d normal(const Hit& hit) const = 0;
  [[nodiscard]] virtual Surface surface(const Hit& hit) const = 0;
  /// A ray from here along any direction above the surface does not meet the point it starts from.
  [[nodiscard]] virtual Eigen::Vector3d lifted(const Hit& hit,
                                               const Eigen::Vector3d& normal) const = 0;

  [[nodiscard]] static Eigen::Vector3d position(const Hit& hit) {
    return {hit.column + hit.u, hit.row + hit.v, hit.z};
  }
};

}  // namespace veneer::simulation
