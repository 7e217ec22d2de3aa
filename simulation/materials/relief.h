// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>
#include <vector>

#include "btf/direction.h"
#include "simulation/materials/height_field.h"

namespace veneer::simulation {

/// A direction of the local frame in the relief's grid frame, whose y follows the rows downwards.
/// The grid frame is left-handed; nothing in an isotropic reflection notices.
[[nodiscard]] inline Eigen::Vector3d grid_from_local(const btf::Direction& direction) {
  return {direction.x(), -direction.y(), direction.z()};
}

/// The geometry of a height field, made for rays. Lengths in cells; z is 0 at the mean height,
/// which is the reference plane of the sample set. Immutable, so thread-safe.
class Relief {
 public:
  /// Where a ray meets the relief. (u, v) in [0, 1]^2 is the place within the cell.
  struct Hit {
    int column{};
    int row{};
    double u{};
    double v{};
    double z{};
  };

  /// @param field  valid (HeightField::check)
  explicit Relief(const HeightField& field);

  [[nodiscard]] int resolution() const { return resolution_; }
  [[nodiscard]] double top() const { return top_; }
  /// The first point at or after `from` in which the ray meets the bilinear relief, or none where
  /// it leaves upwards, or runs level for more than 64 tiles.
  /// @param from  any place of the periodic plane; one below the relief is a hit at once.
  /// @param direction  of unit length, grid frame
  [[nodiscard]] std::optional<Hit> first_hit(const Eigen::Vector3d& from,
                                             const Eigen::Vector3d& direction) const;
  /// The true normal of the bilinear patch, unit, grid frame; z > 0.
  [[nodiscard]] Eigen::Vector3d normal(const Hit& hit) const;
  [[nodiscard]] Eigen::Vector3d position(const Hit& hit) const {
    return {hit.column + hit.u, hit.row + hit.v, hit.z};
  }
  /// A ray from here along any direction above the surface does not meet the point it starts from.
  [[nodiscard]] Eigen::Vector3d lifted(const Hit& hit, const Eigen::Vector3d& normal) const;
  /// The point of the relief at (u, v) of a cell.
  [[nodiscard]] Hit point(int column, int row, double u, double v) const;

 private:
  // z(u, v) = base + slope_u u + slope_v v + twist u v
  struct Patch {
    float base, slope_u, slope_v, twist, top;
  };
  [[nodiscard]] const Patch& patch(int column, int row) const {
    return patches_[static_cast<std::size_t>(row) * static_cast<std::size_t>(resolution_) +
                    static_cast<std::size_t>(column)];
  }
  int resolution_ = 0;
  double top_ = 0.0;
  std::vector<Patch> patches_;
};

}  // namespace veneer::simulation
