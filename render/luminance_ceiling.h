// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <vector>

#include "calibration/colour_residual.h"
#include "calibration/profile.h"

namespace veneer::render {

/// Halvings in the search for what is under the ceiling: over a root, so that a dark result is
/// found as well as a bright one, to one part in ten thousand down to a hundredth of the wanted
/// light.
inline constexpr int kCeilingSteps = 16;

/// What a profile's own model says that codes send, and the most that it may be.
class LuminanceCeiling {
 public:
  /// None.
  LuminanceCeiling() = default;
  /// @param nits  RendererOptions::luminance_ceiling, cd/m^2; 0: none.
  LuminanceCeiling(const calibration::ProjectorProfile& profile, double nits);

  [[nodiscard]] bool active() const { return nits_ > 0.0; }
  [[nodiscard]] double nits() const { return nits_; }
  /// What is allowed: less than the ceiling by a hundred thousandth, which single precision cannot
  /// hide (its errors here are twenty times smaller).
  [[nodiscard]] double limit() const { return nits_ * (1.0 - 1e-5); }
  /// Y of M (t + rho(t)) + k for the t of the codes, cd/m^2: of a perfect diffuser where G is 1.
  [[nodiscard]] double luminance(const std::array<std::uint16_t, 3>& codes) const;
  /// False for NaN.
  [[nodiscard]] bool allows(const std::array<std::uint16_t, 3>& codes) const {
    return luminance(codes) <= limit();
  }

  /// What luminance() is made of, for the shader: t of every code of a channel, rho, and Y of the
  /// primaries and of black.
  [[nodiscard]] const std::array<std::vector<double>, 3>& tone_curves() const {
    return tone_curves_;
  }
  [[nodiscard]] const calibration::ColourResidual& residual() const { return residual_; }
  [[nodiscard]] const Eigen::Vector3d& primaries_nits() const { return primaries_nits_; }
  [[nodiscard]] double black_nits() const { return black_nits_; }

 private:
  double nits_ = 0;
  std::array<std::vector<double>, 3> tone_curves_;
  calibration::ColourResidual residual_;
  Eigen::Vector3d primaries_nits_ = Eigen::Vector3d::Zero();
  double black_nits_ = 0;
};

}  // namespace veneer::render
