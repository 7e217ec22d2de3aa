// SPDX-License-Identifier: Apache-2.0
#include "calibration/drive_correction.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

#include "base/result.h"

namespace veneer::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// A thousandth of the smallest step of a 16-bit code's light near full drive.
constexpr double kSolved = 1e-10;
constexpr int kMostSteps = 60;
constexpr int kMostHalvings = 12;
// Over which slopes are taken. The wide one sees a crease before it is crossed, the narrow one is
// right where the form of the grid, linear in sqrt(t), matters: in the first cells above black.
constexpr double kWide = 1e-3;
constexpr double kNarrow = 1e-7;

// d(tau + rho)/d tau, by central differences of `step`.
Matrix3d slopes(const ColourResidual& rho, const Vector3d& tau, double step) {
  Matrix3d jacobian = Matrix3d::Identity();
  for (int c = 0; c < 3; ++c) {
    const Vector3d along = step * Vector3d::Unit(c);
    jacobian.col(c) += (rho(tau + along) - rho(tau - along)) / (2.0 * step);
  }
  return jacobian;
}

double largest(const ColourResidual& rho) {
  double most = 0.0;
  for (const Vector3d& value : rho.values()) most = std::max(most, value.cwiseAbs().maxCoeff());
  return most;
}

// solve_drive, with the largest |rho| known.
Vector3d solve(const ColourResidual& rho, double most, const Vector3d& wanted) {
  const Vector3d lowest = wanted.array() - most;
  const Vector3d highest = wanted.array() + most;
  const auto miss_of = [&](const Vector3d& tau) -> Vector3d { return tau + rho(tau) - wanted; };
  Vector3d tau = wanted;
  Vector3d miss = miss_of(tau);
  for (int i = 0; i < kMostSteps && miss.cwiseAbs().maxCoeff() > kSolved; ++i) {
    bool nearer = false;
    for (const double width : {kWide, kNarrow}) {
      const Vector3d way = slopes(rho, tau, width).fullPivLu().solve(miss);
      if (!way.allFinite()) continue;
      double part = 1.0;
      for (int j = 0; j < kMostHalvings && !nearer; ++j, part *= 0.5) {
        const Vector3d tried = (tau - part * way).cwiseMax(lowest).cwiseMin(highest);
        const Vector3d tried_miss = miss_of(tried);
        if (!(tried_miss.norm() < miss.norm())) continue;
        tau = tried;
        miss = tried_miss;
        nearer = true;
      }
      if (nearer) break;
    }
    if (!nearer) break;
  }
  return tau;
}

// Where the nodes must lie for all that the projector can send to be between them.
DriveCorrection::Axes axes_for(const ColourResidual& rho, int nodes) {
  // Full drive of a channel; a smaller one, or none, is no projector's and would be divided by.
  constexpr double kLeastFull = 0.1;
  const Vector3d full = (Vector3d::Ones() + rho(Vector3d::Ones())).cwiseMax(kLeastFull);
  double lowest = 0.0;
  double highest = 1.0;
  const int n = rho.nodes();
  const auto drive_at = [n](std::size_t i) {
    return std::pow(static_cast<double>(i) / (n - 1), 2);
  };
  for (std::size_t i = 0; i < rho.values().size(); ++i) {
    const auto across = static_cast<std::size_t>(n);
    const Vector3d t(
        drive_at(i % across), drive_at(i / across % across), drive_at(i / across / across));
    const Vector3d part = (t + rho.values()[i]).cwiseQuotient(full);
    lowest = std::min(lowest, part.minCoeff());
    highest = std::max(highest, part.maxCoeff());
  }
  // The fewest nodes outside that reach as far; no more than a quarter of all on each side, so that
  // a hostile rho leaves some between.
  const double below = std::sqrt(-lowest);
  const double above = std::sqrt(highest) - 1.0;
  DriveCorrection::Axes axes{full, nodes - 1, 0};
  constexpr double kRounding = 1e-9;  // of a node that reaches exactly as far as it must
  for (int outside = 0;; ++outside) {
    axes.steps = nodes - 1 - outside;
    axes.below = std::min(static_cast<int>(std::ceil(below * axes.steps - kRounding)), nodes / 4);
    const int over =
        std::min(static_cast<int>(std::ceil(above * axes.steps - kRounding)), nodes / 4);
    if (axes.below + over <= outside) return axes;
  }
}

}  // namespace

Vector3d solve_drive(const ColourResidual& rho, const Vector3d& wanted) {
  return solve(rho, largest(rho), wanted);
}

DriveCorrection::DriveCorrection(const ColourResidual& rho, int nodes) {
  if (rho.empty()) return;
  VENEER_CHECK(nodes >= 5);
  axes_ = axes_for(rho, nodes);
  const double most = largest(rho);
  corrections_ = ColourResidual::sampled(nodes, [&](const Vector3d& squared) -> Vector3d {
    const Vector3d node = squared.cwiseSqrt() * (nodes - 1);
    const Vector3d s = (node.array() - axes_.below) / axes_.steps;
    const Vector3d wanted = axes_.full.cwiseProduct(s.cwiseProduct(s.cwiseAbs()));
    return solve(rho, most, wanted) - wanted;
  });
}

Vector3d DriveCorrection::operator()(const Vector3d& wanted) const {
  if (empty()) return wanted;
  const Vector3d part = wanted.cwiseQuotient(axes_.full);
  const Vector3d s = part.cwiseSign().cwiseProduct(part.cwiseAbs().cwiseSqrt());
  const Vector3d node = (axes_.steps * s).array() + axes_.below;
  return wanted + corrections_((node.cwiseMax(0.0) / (nodes() - 1.0)).cwiseAbs2());
}

}  // namespace veneer::calibration
