// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// A model that is defined inside the cube of drives. Beyond it, it goes straight on from the
/// nearest point of the cube, with the slope that it has there.
class CubeModel : public ColourModel {
 public:
  [[nodiscard]] Xyz forward(const Eigen::Vector3d& drive) const final;
  /// Beyond the cube that of the nearest point of the cube.
  [[nodiscard]] Eigen::Matrix3d jacobian(const Eigen::Vector3d& drive) const final;
  [[nodiscard]] bool is_additive() const final { return false; }

 private:
  /// @param drive  in [0, 1]^3.
  [[nodiscard]] virtual Xyz inside(const Eigen::Vector3d& drive) const = 0;
  [[nodiscard]] virtual Eigen::Matrix3d slope_inside(const Eigen::Vector3d& drive) const = 0;
};

}  // namespace veneer::calibration
