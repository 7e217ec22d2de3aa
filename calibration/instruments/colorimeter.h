// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <string>

#include "base/colour.h"
#include "base/result.h"

namespace veneer::calibration {

/// What the colorimeter is pointed at: a flat board that stands square to the projector's axis, its
/// plane at the reference distance from the lens. (So the spot of a pixel at angle a off the axis
/// is lit cos^3(a) times as strongly as one that faces the lens at that distance: 1 / r^2 gives two
/// cosines, the slant one.)
enum class Target {
  kWhiteReference,  ///< a perfect diffuser
  kObject,          ///< the object's surface, in the same place
};

/// The colorimeter HAL. One thread.
class Colorimeter {
 public:
  virtual ~Colorimeter() = default;
  [[nodiscard]] virtual std::string description() const = 0;
  /// One reading, XYZ in cd/m^2, of the spot that the projector pixel `pixel` lights.
  /// Errors: kTimeout (try again), kDisconnected.
  [[nodiscard]] virtual Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) = 0;
};

}  // namespace veneer::calibration
