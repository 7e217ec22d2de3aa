// SPDX-License-Identifier: Apache-2.0
#include "tracking/eye_offset.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/statistics.h"
#include "base/units.h"

namespace veneer::tracking {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kFewestPoses = 50;
constexpr std::size_t kParts = 10;  // of the session, left out in turn

struct Pose {
  Matrix3d rotation;
  Vector3d position;
  std::size_t part = 0;  // in which it was measured
  double weight = 1;     // 0: left out
};

struct Pivot {
  Vector3d offset = Vector3d::Zero();  // in the sensor
  Vector3d place = Vector3d::Zero();   // in the world
  [[nodiscard]] double residual_of(const Pose& pose) const {
    return (pose.rotation * offset + pose.position - place).norm();
  }
};

/// Least squares for R t + p = e. With e = mean(R) t + mean(p) out of the way,
///   mean((R - mean R)^T (R - mean R)) t = -mean((R - mean R)^T (p - mean p));
/// directions that no rotation tells anything of get an offset of 0.
Pivot fit(const std::vector<Pose>& poses, std::size_t left_out = kParts) {
  const auto weight_of = [&](const Pose& pose) {
    return pose.part == left_out ? 0.0 : pose.weight;
  };
  double sum = 0;
  Matrix3d mean_rotation = Matrix3d::Zero();
  Vector3d mean_position = Vector3d::Zero();
  for (const Pose& pose : poses) {
    sum += weight_of(pose);
    mean_rotation += weight_of(pose) * pose.rotation;
    mean_position += weight_of(pose) * pose.position;
  }
  if (!(sum > 0)) return {};
  mean_rotation /= sum;
  mean_position /= sum;
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Pose& pose : poses) {
    const Matrix3d turned = pose.rotation - mean_rotation;
    normal += weight_of(pose) / sum * turned.transpose() * turned;
    right -= weight_of(pose) / sum * turned.transpose() * (pose.position - mean_position);
  }
  // Squares of sines of the turning: below a thousandth of a degree it is rounding.
  constexpr double kNothing = 3e-10;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(normal);
  Pivot pivot;
  for (int i = 0; i < 3; ++i) {
    const Vector3d axis = axes.eigenvectors().col(i);
    if (axes.eigenvalues()[i] > kNothing)
      pivot.offset += axis * axis.dot(right) / axes.eigenvalues()[i];
  }
  pivot.place = mean_rotation * pivot.offset + mean_position;
  return pivot;
}

/// Marks the poses that do not fit the others with a weight of 0, all others with 1.
void drop_outliers(std::vector<Pose>& poses) {
  // The least sum of distances first, which gross outliers hardly move, by least squares whose
  // weights are one over the distance. Source: Chartrand and Yin 2008, "Iteratively Reweighted
  // Algorithms for Compressive Sensing", for p = 1.
  constexpr int kRounds = 30;
  constexpr double kNear_m = 1e-5;  // nearer than any tracker can tell
  for (int round = 0; round < kRounds; ++round) {
    const Pivot pivot = fit(poses);
    for (Pose& pose : poses) pose.weight = 1 / std::max(kNear_m, pivot.residual_of(pose));
  }
  // Then whatever is farther out than 4 standard deviations, of which the median distance is 1.538:
  // one pose of a thousand of a normal distribution in three dimensions.
  for (int round = 0; round < kRounds; ++round) {
    const Pivot pivot = fit(poses);
    std::vector<double> residuals;
    for (const Pose& pose : poses) residuals.push_back(pivot.residual_of(pose));
    const double limit_m = std::max(kNear_m, 4 / 1.538 * quantile(residuals, 0.5));
    bool changed = false;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const double weight = residuals[i] <= limit_m ? 1 : 0;
      changed = changed || weight != poses[i].weight;
      poses[i].weight = weight;
    }
    if (!changed) return;
  }
}

Vector3d span_of(const std::vector<Pose>& poses) {
  Matrix3d sum = Matrix3d::Zero();
  for (const Pose& pose : poses) sum += pose.weight * pose.rotation;
  const Eigen::JacobiSVD<Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vector3d signs(1, 1, svd.matrixU().determinant() * svd.matrixV().determinant());
  const Matrix3d middle = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();

  std::vector<Vector3d> turns;  // rotation vectors from the middle, in the sensor's frame
  Matrix3d spread = Matrix3d::Zero();
  for (const Pose& pose : poses) {
    if (pose.weight <= 0) continue;
    const Eigen::AngleAxisd turn(Matrix3d(middle.transpose() * pose.rotation));
    turns.emplace_back(turn.angle() * turn.axis());
    spread += turns.back() * turns.back().transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(spread);
  Vector3d span_deg;
  for (int i = 0; i < 3; ++i) {
    std::vector<double> angles;
    for (const Vector3d& turn : turns) angles.push_back(axes.eigenvectors().col(i).dot(turn));
    span_deg[i] = to_degrees(Radians{quantile(angles, 0.98) - quantile(angles, 0.02)}).value;
  }
  std::sort(span_deg.begin(), span_deg.end(), [](double a, double b) { return a > b; });
  return span_deg;
}

}  // namespace

double EyeOffset::deviation_m() const {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, axes.eigenvalues().maxCoeff()));
}

Result<EyeOffset> measure_eye_offset(const PoseHistory& history) {
  const std::vector<PoseSample>& samples = history.samples();
  if (samples.size() < kFewestPoses) {
    return fail(Errc::kBadFormat,
                "measuring the eye offset: {} poses are too few; turn the head for some seconds, "
                "at least {} poses are needed",
                samples.size(),
                kFewestPoses);
  }
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    poses.push_back({samples[i].world_from_body.rotation.toRotationMatrix(),
                     samples[i].world_from_body.translation,
                     i * kParts / samples.size()});
  }
  drop_outliers(poses);
  const Pivot pivot = fit(poses);

  EyeOffset result;
  result.eye_in_sensor = pivot.offset;
  result.eye_in_world = pivot.place;
  result.span_deg = span_of(poses);
  std::vector<Pivot> without;
  Vector3d mean_without = Vector3d::Zero();
  for (std::size_t part = 0; part < kParts; ++part) {
    without.push_back(fit(poses, part));
    mean_without += without.back().offset / kParts;
  }
  // Shao and Wu 1989, "A General Theory for Jackknife Variance Estimation": leaving out groups.
  for (const Pivot& each : without) {
    const Vector3d off = each.offset - mean_without;
    result.covariance += off * off.transpose() * (kParts - 1.0) / kParts;
  }
  double squares = 0;
  double held_out_squares = 0;
  for (const Pose& pose : poses) {
    if (pose.weight <= 0) continue;
    ++result.used;
    squares += std::pow(pivot.residual_of(pose), 2);
    held_out_squares += std::pow(without[pose.part].residual_of(pose), 2);
  }
  result.outliers = poses.size() - result.used;
  const double used = static_cast<double>(std::max<std::size_t>(1, result.used));
  result.residual_m = std::sqrt(squares / used);
  result.held_out_m = std::sqrt(held_out_squares / used);
  return result;
}

Status check(const EyeOffset& offset, const EyeOffsetLimits& limits) {
  constexpr std::string_view kDoing = "measuring the eye offset";
  if (!(offset.span_deg[1] >= limits.least_span_deg)) {
    return fail(
        Errc::kUnavailable,
        "{}: the head turned by {:.1f} degrees about one axis and by {:.1f} about a second, "
        "at least {:g} about both are needed; nod, shake and tilt it",
        kDoing,
        offset.span_deg[0],
        offset.span_deg[1],
        limits.least_span_deg);
  }
  const double all = static_cast<double>(offset.used + offset.outliers);
  if (!(static_cast<double>(offset.outliers) <= limits.most_outliers * all)) {
    return fail(Errc::kUnavailable,
                "{}: {} of {} poses do not fit the others, at most {:.0f} % may; keep the eye in "
                "its place from the first moment to the last",
                kDoing,
                offset.outliers,
                offset.used + offset.outliers,
                100 * limits.most_outliers);
  }
  if (!(offset.residual_m <= limits.most_residual_m)) {
    return fail(Errc::kUnavailable,
                "{}: the eye was {:.2f} mm from its place (rms), at most {:g} mm are allowed; keep "
                "it there, at a peephole, and see that the sensor sits firmly on the head",
                kDoing,
                1e3 * offset.residual_m,
                1e3 * limits.most_residual_m);
  }
  if (!(offset.deviation_m() <= limits.most_deviation_m)) {
    return fail(Errc::kUnavailable,
                "{}: the offset is known to {:.2f} mm only, {:g} mm are needed; turn the head "
                "farther, for longer, and about all axes again and again",
                kDoing,
                1e3 * offset.deviation_m(),
                1e3 * limits.most_deviation_m);
  }
  return {};
}

}  // namespace veneer::tracking
