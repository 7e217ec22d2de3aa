// SPDX-License-Identifier: Apache-2.0
#include "calibration/colour/inverse.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "base/ipt.h"

namespace veneer::calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Values of a tone curve by which drives are found from linear ones: between them the search goes
/// on in the model itself, so that they need not be exact.
constexpr int kToneValues = 1025;
/// Points along an axis of the grid that a second start is taken from.
constexpr int kGridPoints = 7;
/// Halvings in the search for the reachable colour, as kGamutSteps of render/compensation.h.
constexpr int kGamutSteps = 12;

Vector3d inside_cube(const Vector3d& point) { return point.cwiseMax(0.0).cwiseMin(1.0); }

}  // namespace

Result<ColourInverse> ColourInverse::make(const ColourModel& model, const Xyz& black) {
  VENEER_ASSIGN(ToneTable table, tone_table(model, kToneValues));
  // A little slope everywhere, so that linear and coded drives are one to one.
  constexpr double kLeastSlope = 1e-7;
  for (std::vector<double>& curve : table.curves) {
    for (int i = 0; i < kToneValues; ++i) {
      double& value = curve[static_cast<std::size_t>(i)];
      value = (1.0 - kLeastSlope) * value + kLeastSlope * i / (kToneValues - 1.0);
    }
  }
  ColourInverse inverse(model, black);
  inverse.white_ = model.forward(Vector3d::Ones());
  if (!inverse.white_.allFinite() || !(inverse.white_.minCoeff() > 0.0) || !black.allFinite())
    return fail(Errc::kBadFormat,
                "inverting {}: black or white is not a light; measure again",
                model.name());
  inverse.tones_ = std::move(table);
  for (int i = 0; i < kGridPoints * kGridPoints * kGridPoints; ++i) {
    const Vector3d root =
        Vector3d(i % kGridPoints, i / kGridPoints % kGridPoints, i / (kGridPoints * kGridPoints)) /
        (kGridPoints - 1.0);
    const Vector3d linear = root.cwiseAbs2();
    inverse.grid_.push_back({linear, inverse.light_of(linear)});
  }
  // The darkest neutral that can be shown; white itself can.
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < kGamutSteps; ++i) {
    const double middle = 0.5 * (low + high);
    const double part = std::pow(middle, 1.0 / kIptExponent);
    const bool reached =
        inverse.solve(part * (inverse.white_ + black) - black).residual <= kReached;
    (reached ? high : low) = middle;
  }
  inverse.darkest_neutral_ = high;
  return inverse;
}

Vector3d ColourInverse::light_of(const Vector3d& linear) const {
  return tones_.linear_from_xyz * model_->forward(tones_.drive_of(linear));
}

double ColourInverse::residual_of(const Xyz& target, const Vector3d& drive) const {
  return (model_->forward(drive) - target).cwiseQuotient(white_).cwiseAbs().maxCoeff();
}

// Least squares of M^-1 (F - target) over the linear drive, from `start`.
ColourInverse::Solution ColourInverse::descend(const Xyz& target, const Vector3d& start) const {
  constexpr double kFirstDamping = 1e-6;
  constexpr double kLargestDamping = 1e6;
  constexpr double kDone = 1e-12;  // rounding, in parts of full drive
  constexpr double kStep = 1e-5;   // of the difference quotients
  const Vector3d wanted = tones_.linear_from_xyz * target;
  Vector3d linear = inside_cube(start);
  Vector3d error = light_of(linear) - wanted;
  double damping = kFirstDamping;
  int iteration = 0;
  while (iteration < kMostIterations && damping < kLargestDamping &&
         error.cwiseAbs().maxCoeff() > kDone) {
    ++iteration;
    Matrix3d slope;
    for (Eigen::Index c = 0; c < 3; ++c) {
      Vector3d beside = linear;
      const double step = linear[c] > 0.5 ? -kStep : kStep;  // stays in the cube
      beside[c] += step;
      slope.col(c) = (light_of(beside) - wanted - error) / step;
    }
    const Vector3d gradient = slope.transpose() * error;
    // A channel that stands at its border and would go beyond it stays where it is.
    Vector3d free = Vector3d::Ones();
    for (Eigen::Index c = 0; c < 3; ++c) {
      if ((linear[c] <= 0.0 && gradient[c] > 0.0) || (linear[c] >= 1.0 && gradient[c] < 0.0))
        free[c] = 0.0;
    }
    const Matrix3d squared = free.asDiagonal() * slope.transpose() * slope * free.asDiagonal();
    bool better = false;
    while (!better && damping < kLargestDamping) {
      Matrix3d damped = squared;
      damped.diagonal().array() += damping + (1.0 - free.array());
      const Vector3d next =
          inside_cube(linear - damped.ldlt().solve(gradient.cwiseProduct(free).eval()));
      const Vector3d next_error = light_of(next) - wanted;
      better = next_error.squaredNorm() < error.squaredNorm();
      if (better) {
        linear = next;
        error = next_error;
        damping = std::max(damping / 10.0, 1e-12);
      } else {
        damping *= 10.0;
      }
    }
  }
  const Vector3d drive = tones_.drive_of(linear);
  return {drive, residual_of(target, drive), iteration};
}

ColourInverse::Solution ColourInverse::solve(const Xyz& target) const {
  if (const std::optional<Vector3d> direct = model_->direct_inverse(target))
    return {*direct, residual_of(target, *direct), 0};
  const Vector3d wanted = tones_.linear_from_xyz * target;
  const Solution first = descend(target, wanted);
  if (first.residual <= kReached) return first;
  const GridPoint& nearest =
      *std::ranges::min_element(grid_, {}, [&wanted](const GridPoint& point) {
        return (point.light - wanted).squaredNorm();
      });
  Solution second = descend(target, nearest.linear);
  second.iterations += first.iterations;
  if (second.residual < first.residual) return second;
  return {first.drive, first.residual, second.iterations};
}

InverseColour ColourInverse::operator()(const Xyz& target) const {
  InverseColour result;
  if (!target.allFinite()) {
    result.residual = HUGE_VAL;
    result.in_gamut = false;
    return result;
  }
  const Solution solution = solve(target);
  result = {
      solution.drive, solution.residual, solution.residual <= kReached, 0.0, solution.iterations};
  if (!result.in_gamut) map_to_gamut(target, result);
  return result;
}

void ColourInverse::map_to_gamut(const Xyz& target, InverseColour& result) const {
  const Xyz white = white_ + black_;
  const Vector3d white_cones = cones_from_xyz() * white;
  const Matrix3d xyz_from_cones = cones_from_xyz().inverse() * white_cones.asDiagonal();
  const Ipt wanted =
      ipt_from_cones((cones_from_xyz() * (target + black_)).cwiseQuotient(white_cones));
  const double quarter = 0.25 * (1.0 - darkest_neutral_);
  const Ipt anchor(std::clamp(wanted.x(), darkest_neutral_ + quarter, 1.0 - quarter), 0.0, 0.0);
  const Ipt way = wanted - anchor;
  const auto colour_at = [&](double kept) -> Xyz {
    return xyz_from_cones * cones_from_ipt(anchor + kept * way) - black_;
  };
  double kept = 0.0;
  double step = 0.5;
  Solution reached = solve(colour_at(0.0));
  result.iterations += reached.iterations;
  for (int i = 0; i < kGamutSteps; ++i, step *= 0.5) {
    const Solution tried = solve(colour_at(kept + step));
    result.iterations += tried.iterations;
    if (tried.residual > kReached) continue;
    kept += step;
    reached = tried;
  }
  result.drive = reached.drive;
  result.residual = reached.residual;
  result.gamut_loss = 100.0 * (1.0 - kept) * way.norm();
}

}  // namespace veneer::calibration
