// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/additive_model.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/result.h"
#include "calibration/colour/ramps.h"

namespace veneer::calibration {
namespace {

constexpr double kRounding = 1e-12;  // of what is 1 at full drive

// The drive at which a curve that does not fall takes a value between those at 0 and at 1.
double drive_at(const DriveCurve& curve, double value) {
  double low = 0.0;
  double high = 1.0;
  constexpr int kHalvings = 52;  // a double's bits
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (value_of(curve, middle) < value ? low : high) = middle;
  }
  return high;
}

}  // namespace

double value_of(const DriveCurve& curve, double drive) {
  return std::visit([drive](const auto& c) { return c(drive); }, curve);
}

double slope_of(const DriveCurve& curve, double drive) {
  return std::visit([drive](const auto& c) { return c.slope_at(drive); }, curve);
}

ChannelLight::ChannelLight(Eigen::Matrix3Xd colours, std::vector<DriveCurve> curves)
    : colours_(std::move(colours)), curves_(std::move(curves)) {
  VENEER_CHECK(!curves_.empty() && colours_.cols() == static_cast<Eigen::Index>(curves_.size()));
}

Xyz ChannelLight::operator()(double drive) const {
  Xyz light = Xyz::Zero();
  for (std::size_t k = 0; k < curves_.size(); ++k)
    light += value_of(curves_[k], drive) * colours_.col(static_cast<Eigen::Index>(k));
  return light;
}

Xyz ChannelLight::slope_at(double drive) const {
  Xyz slope = Xyz::Zero();
  for (std::size_t k = 0; k < curves_.size(); ++k)
    slope += slope_of(curves_[k], drive) * colours_.col(static_cast<Eigen::Index>(k));
  return slope;
}

AdditiveModel::AdditiveModel(std::string_view name,
                             std::array<ChannelLight, 3> channels,
                             int parameters)
    : name_(name), channels_(std::move(channels)), parameters_(parameters) {
  for (std::size_t c = 0; c < 3; ++c)
    primaries_.col(static_cast<Eigen::Index>(c)) = channels_[c](1.0);
  VENEER_CHECK(are_independent(primaries_));
  linear_from_xyz_ = primaries_.inverse();
}

Xyz AdditiveModel::forward(const Eigen::Vector3d& drive) const {
  if (drive.hasNaN()) return Xyz::Constant(std::nan(""));
  return channels_[0](drive[0]) + channels_[1](drive[1]) + channels_[2](drive[2]);
}

Eigen::Matrix3d AdditiveModel::jacobian(const Eigen::Vector3d& drive) const {
  Eigen::Matrix3d jacobian;
  jacobian << channels_[0].slope_at(drive[0]), channels_[1].slope_at(drive[1]),
      channels_[2].slope_at(drive[2]);
  return jacobian;
}

std::optional<Eigen::Vector3d> AdditiveModel::direct_inverse(const Xyz& xyz) const {
  if (!std::ranges::all_of(channels_, &ChannelLight::keeps_chromaticity)) return std::nullopt;
  const Eigen::Vector3d wanted = linear_from_xyz_ * xyz;
  if (!(wanted.minCoeff() >= -kRounding && wanted.maxCoeff() <= 1.0 + kRounding))
    return std::nullopt;
  Eigen::Vector3d drive;
  for (std::size_t c = 0; c < 3; ++c) {
    const DriveCurve& curve = channels_[c].curve(0);
    const double full = value_of(curve, 1.0);
    const auto i = static_cast<Eigen::Index>(c);
    // Bisection would find the end of a curve that starts flat.
    drive[i] = wanted[i] <= 0.0 ? 0.0 : drive_at(curve, std::min(wanted[i], 1.0) * full);
  }
  return drive;
}

Eigen::Vector3d AdditiveModel::linear_drive(const Eigen::Vector3d& drive) const {
  Eigen::Vector3d linear;
  for (Eigen::Index c = 0; c < 3; ++c)
    linear[c] = linear_from_xyz_.row(c) * channels_[static_cast<std::size_t>(c)](drive[c]);
  return linear;
}

Eigen::Vector3d AdditiveModel::linear_drive_slope(const Eigen::Vector3d& drive) const {
  Eigen::Vector3d slope;
  for (Eigen::Index c = 0; c < 3; ++c)
    slope[c] = linear_from_xyz_.row(c) * channels_[static_cast<std::size_t>(c)].slope_at(drive[c]);
  return slope;
}

}  // namespace veneer::calibration
