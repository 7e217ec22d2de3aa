// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>
#include <vector>

#include "simulation/materials/geometry.h"
#include "simulation/materials/height_field.h"

namespace veneer::simulation {

/// The bilinear relief of a height field. Its z is 0 at the mean height. A cell's surface is that
/// of the field.
class Relief final : public Geometry {
 public:
  /// @param field  valid (HeightField::check)
  explicit Relief(const HeightField& field);

  [[nodiscard]] int resolution() const override { return resolution_; }
  [[nodiscard]] double top() const override { return top_; }
  /// Gives up on a ray that runs level for more than 64 tiles.
  [[nodiscard]] std::optional<Hit> first_hit(const Eigen::Vector3d& from,
                                             const Eigen::Vector3d& direction) const override;
  /// The true normal of the bilinear patch; z > 0.
  [[nodiscard]] Eigen::Vector3d normal(const Hit& hit) const override;
  [[nodiscard]] Surface surface(const Hit& hit) const override;
  [[nodiscard]] Eigen::Vector3d lifted(const Hit& hit,
                                       const Eigen::Vector3d& normal) const override;
  /// The point of the relief at (u, v) of a cell.
  [[nodiscard]] Hit point(int column, int row, double u, double v) const;

 private:
  // z(u, v) = base + slope_u u + slope_v v + twist u v
  struct Patch {
    float base, slope_u, slope_v, twist, top;
  };
  [[nodiscard]] std::size_t cell(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(resolution_) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] const Patch& patch(int column, int row) const {
    return patches_[cell(column, row)];
  }
  int resolution_ = 0;
  double top_ = 0.0;
  std::vector<Patch> patches_;
  std::vector<Surface> surfaces_;
};

}  // namespace veneer::simulation
