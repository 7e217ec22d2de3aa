// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/colour.h"
#include "base/result.h"

namespace veneer::calibration {

/// One uniform patch and what an instrument read of it.
struct PatchReading {
  Eigen::Vector3d drive = Eigen::Vector3d::Zero();  ///< code / (2^bits - 1), in [0, 1]^3
  Xyz xyz = Xyz::Zero();                            ///< cd/m^2
};

/// From a projector's drive to the light that it sends, above black.
class ColourModel {
 public:
  virtual ~ColourModel() = default;
  /// As in colour_model_families().
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// XYZ above black, in cd/m^2 as the readings were; forward(0) = 0.
  /// @param drive  in [0, 1]^3; beyond the cube the model goes on with the slope that it has at the
  ///               border, so that an inverse has somewhere to go. NaN for NaN.
  [[nodiscard]] virtual Xyz forward(const Eigen::Vector3d& drive) const = 0;
  /// d forward / d drive, XYZ along rows.
  [[nodiscard]] virtual Eigen::Matrix3d jacobian(const Eigen::Vector3d& drive) const = 0;
  /// Whether forward(r, g, b) = forward(r, 0, 0) + forward(0, g, 0) + forward(0, 0, b).
  [[nodiscard]] virtual bool is_additive() const = 0;
  /// Numbers that were fitted.
  [[nodiscard]] virtual int parameters() const = 0;
  /// A drive in [0, 1]^3 whose forward() is `xyz`, for models that can tell it without searching
  /// from a start; nothing where the model cannot, or where the colour is out of its reach.
  [[nodiscard]] virtual std::optional<Eigen::Vector3d> direct_inverse(const Xyz& xyz) const {
    (void)xyz;
    return std::nullopt;
  }
};

/// One line of the registry of models.
struct ColourModelFamily {
  std::string_view name;
  std::string_view summary;
  /// Whether the model is for projectors whose channels do not add up; such need patches in which
  /// several channels are driven.
  bool models_interaction = false;
  /// @param patches  readings of black, ramps and whatever else was measured; ambient light and
  ///                 black still in them.
  /// @param black  what drive 0 reads, averaged.
  /// Errors: kBadFormat (too few or contradicting patches; says which are missing).
  Result<std::unique_ptr<ColourModel>> (*fit)(std::span<const PatchReading> patches,
                                              const Xyz& black);
};

/// Every colour model, sorted by name.
[[nodiscard]] std::span<const ColourModelFamily> colour_model_families();

}  // namespace veneer::calibration
