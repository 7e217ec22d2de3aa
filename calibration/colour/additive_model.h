// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <optional>
#include <string_view>
#include <variant>
#include <vector>

#include "calibration/colour/colour_model.h"
#include "calibration/colour/gog/gain_offset_gamma.h"
#include "calibration/interpolation.h"

namespace veneer::calibration {

/// A number over a channel's drive.
using DriveCurve = std::variant<PiecewiseLinear, CubicHermite, GainOffsetGamma>;
[[nodiscard]] double value_of(const DriveCurve& curve, double drive);
[[nodiscard]] double slope_of(const DriveCurve& curve, double drive);

/// The light of one channel: sum over k of a colour times a curve over the drive. One colour is a
/// channel that keeps its chromaticity; the unit vectors are X, Y and Z each for itself.
class ChannelLight {
 public:
  /// @param colours  one to three columns, XYZ.   @param curves  as many, 0 at drive 0.
  ChannelLight(Eigen::Matrix3Xd colours, std::vector<DriveCurve> curves);
  [[nodiscard]] Xyz operator()(double drive) const;
  [[nodiscard]] Xyz slope_at(double drive) const;
  [[nodiscard]] bool keeps_chromaticity() const { return curves_.size() == 1; }
  [[nodiscard]] const Eigen::Matrix3Xd& colours() const { return colours_; }
  [[nodiscard]] const DriveCurve& curve(std::size_t k) const { return curves_[k]; }

 private:
  Eigen::Matrix3Xd colours_;
  std::vector<DriveCurve> curves_;
};

/// XYZ = sum over channels of what each sends alone: the form of all models that know nothing of
/// what channels do to each other, and the core of those that do.
class AdditiveModel final : public ColourModel {
 public:
  /// @param name  a literal.   @param channels  of independent colours at full drive (checked).
  /// @param parameters  what ColourModel::parameters() says.
  AdditiveModel(std::string_view name, std::array<ChannelLight, 3> channels, int parameters);

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] Xyz forward(const Eigen::Vector3d& drive) const override;
  [[nodiscard]] Eigen::Matrix3d jacobian(const Eigen::Vector3d& drive) const override;
  [[nodiscard]] bool is_additive() const override { return true; }
  [[nodiscard]] int parameters() const override { return parameters_; }
  /// Where every channel keeps its chromaticity: the matrix, then each curve by bisection, which
  /// wants curves that do not fall.
  [[nodiscard]] std::optional<Eigen::Vector3d> direct_inverse(const Xyz& xyz) const override;

  /// M: XYZ at full drive, along columns.
  [[nodiscard]] const Eigen::Matrix3d& primaries() const { return primaries_; }
  /// Per channel what its light has along its own primary: 1 at full drive.
  [[nodiscard]] Eigen::Vector3d linear_drive(const Eigen::Vector3d& drive) const;
  [[nodiscard]] Eigen::Vector3d linear_drive_slope(const Eigen::Vector3d& drive) const;

 private:
  std::string_view name_;
  std::array<ChannelLight, 3> channels_;
  int parameters_;
  Eigen::Matrix3d primaries_;
  Eigen::Matrix3d linear_from_xyz_;
};

}  // namespace veneer::calibration
