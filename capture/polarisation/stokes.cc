// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisation/stokes.h"

#include <Eigen/SVD>

#include <cmath>
#include <numbers>
#include <utility>

#include "base/result.h"

namespace veneer::capture {
namespace {

/// Smallest over largest singular value below which angles count as too near to each other.
constexpr double kLeastCondition = 0.01;

/// What a row of analysers passes, row by row. @param leak  1 / extinction.
Eigen::MatrixXd forward_of(std::span<const double> angles_rad, double leak) {
  Eigen::MatrixXd forward(static_cast<Eigen::Index>(angles_rad.size()), 3);
  for (Eigen::Index i = 0; i < forward.rows(); ++i) {
    const double twice = 2 * angles_rad[static_cast<std::size_t>(i)];
    forward.row(i) << 1 + leak, (1 - leak) * std::cos(twice), (1 - leak) * std::sin(twice);
  }
  return 0.5 * forward;
}

Eigen::Map<const Eigen::VectorXd> as_vector(std::span<const double> values, Eigen::Index size) {
  VENEER_CHECK(static_cast<Eigen::Index>(values.size()) == size);
  return {values.data(), size};
}

}  // namespace

StokesSolver::StokesSolver(Eigen::MatrixXd forward)
    : forward_(std::move(forward)),
      inverse_(forward_.jacobiSvd(Eigen::ComputeThinU | Eigen::ComputeThinV)
                   .solve(Eigen::MatrixXd::Identity(forward_.rows(), forward_.rows()))) {}

Result<StokesSolver> StokesSolver::create(std::span<const double> angles_rad, double extinction) {
  if (!(extinction > 1))
    return fail(Errc::kInvalidOption,
                "Stokes parameters: an analyser's extinction of {} is not above 1; give Imax / "
                "Imin, which the maker states (300 for example)",
                extinction);
  for (const double angle : angles_rad) {
    if (!std::isfinite(angle))
      return fail(Errc::kInvalidOption, "Stokes parameters: {} is no angle of an analyser", angle);
  }
  constexpr const char* kAdvice =
      "three different ones are needed within half a turn (0 and 180 degrees are one): take 0, 45, "
      "90 and 135 degrees";
  if (angles_rad.size() < 3)
    return fail(Errc::kInvalidOption,
                "Stokes parameters: {} angles of the analyser say too little; {}",
                angles_rad.size(),
                kAdvice);
  const Eigen::Vector3d values = forward_of(angles_rad, 0).jacobiSvd().singularValues();
  if (values[2] < kLeastCondition * values[0])
    return fail(Errc::kInvalidOption,
                "Stokes parameters: the {} angles of the analyser are too near to each other; {}",
                angles_rad.size(),
                kAdvice);
  return StokesSolver(forward_of(angles_rad, 1 / extinction));
}

LinearStokes StokesSolver::solve(std::span<const double> readings) const {
  return inverse_ * as_vector(readings, inverse_.cols());
}

Eigen::Matrix3d StokesSolver::covariance(std::span<const double> variance) const {
  return inverse_ * as_vector(variance, inverse_.cols()).asDiagonal() * inverse_.transpose();
}

double StokesSolver::residual(std::span<const double> readings, const LinearStokes& stokes) const {
  const Eigen::VectorXd left = as_vector(readings, forward_.rows()) - forward_ * stokes;
  return std::sqrt(left.squaredNorm() / static_cast<double>(left.size()));
}

double degree_of_polarisation(const LinearStokes& stokes) {
  if (!(stokes[0] > 0)) return 0;
  return std::hypot(stokes[1], stokes[2]) / stokes[0];
}

double angle_of_polarisation(const LinearStokes& stokes) {
  using std::numbers::pi;
  const double angle = 0.5 * std::atan2(stokes[2], stokes[1]);
  const double turned = angle < 0 ? angle + pi : angle;
  return turned >= pi ? 0 : turned;  // a tiny negative angle rounds to pi
}

}  // namespace veneer::capture
