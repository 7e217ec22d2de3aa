// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>

#include "calibration/geometry/internal_consensus.h"
#include "calibration/geometry/registration.h"

namespace veneer::geometry {
namespace {

constexpr std::size_t kLeastPairs = 4;  // three make a pose, the fourth can contradict
/// Median length of a vector whose three coordinates are normal with deviation 1.
constexpr double kUsualMedian = 1.538;
constexpr int kRefits = 5;  // after which the set of inliers does not change any more

/// The rigid b_from_a with the least weighted squares; absent if the points are on a line.
std::optional<RigidTransform> rigid_fit(std::span<const PointPair> pairs,
                                        std::span<const std::size_t> used) {
  double weights = 0;
  Eigen::Vector3d middle_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d middle_b = Eigen::Vector3d::Zero();
  for (const std::size_t i : used) {
    const double weight = 1 / (pairs[i].deviation_m * pairs[i].deviation_m);
    weights += weight;
    middle_a += weight * pairs[i].x_in_a;
    middle_b += weight * pairs[i].x_in_b;
  }
  middle_a /= weights;
  middle_b /= weights;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const std::size_t i : used) {
    const double weight = 1 / (pairs[i].deviation_m * pairs[i].deviation_m) / weights;
    covariance += weight * (pairs[i].x_in_b - middle_b) * (pairs[i].x_in_a - middle_a).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  constexpr double kLeastRatio = 1e-9;  // of singular values, where the turning is open
  if (!(svd.singularValues()[1] > kLeastRatio * svd.singularValues()[0])) return std::nullopt;
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs[2] = -1;
  RigidTransform b_from_a;
  b_from_a.rotation = Eigen::Quaterniond(
      Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()));
  b_from_a.translation = middle_b - b_from_a.rotation * middle_a;
  return b_from_a;
}

std::vector<double> distances_of(std::span<const PointPair> pairs, const RigidTransform& b_from_a) {
  std::vector<double> distances;
  for (const PointPair& pair : pairs)
    distances.push_back((b_from_a * pair.x_in_a - pair.x_in_b).norm() / pair.deviation_m);
  return distances;
}

std::vector<std::size_t> indices_of(const std::vector<bool>& inlier) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < inlier.size(); ++i)
    if (inlier[i]) indices.push_back(i);
  return indices;
}

Status check_extent(std::span<const Eigen::Vector3d> points,
                    const PointRegistrationOptions& options,
                    std::vector<std::string>& warnings) {
  const Eigen::Vector3d extents = extents_of(points);
  if (!(extents[1] >= options.least_extent_m)) {
    return fail(Errc::kBadFormat,
                "registering points: they lie within {:.1f} mm of one line, which leaves open how "
                "the object is turned about it; touch points well off that line",
                1e3 * extents[1]);
  }
  if (extents[2] < 0.1 * options.least_extent_m) {
    warnings.push_back(
        "the points lie in one plane; that suffices, but one well off it would check the result");
  }
  return {};
}

/// Standard deviations of the middle and of the turning, from the inverse of the normal equations.
void fill_deviations(std::span<const PointPair> pairs,
                     std::span<const std::size_t> used,
                     PointRegistration& result) {
  double weights = 0;
  double squares = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const std::size_t i : used) {
    const double weight = 1 / (pairs[i].deviation_m * pairs[i].deviation_m);
    weights += weight;
    middle += weight * pairs[i].x_in_a;
    squares += weight * result.distance_m[i] * result.distance_m[i];
  }
  middle /= weights;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const std::size_t i : used) {
    const Eigen::Vector3d x = pairs[i].x_in_a - middle;
    information += (x.squaredNorm() * Eigen::Matrix3d::Identity() - x * x.transpose()) /
                   (pairs[i].deviation_m * pairs[i].deviation_m);
  }
  // Deviations that were stated too small do not make the answer better than it is.
  const double freedom = 3 * static_cast<double>(used.size()) - 6;
  const double scatter = std::max(1.0, squares / freedom);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information, Eigen::EigenvaluesOnly);
  result.position_deviation_m = std::sqrt(scatter / weights);
  result.rotation_deviation_rad = std::sqrt(scatter / solver.eigenvalues()[0]);
}

}  // namespace

TouchedPoint touched_point(const tracking::SynchronisedPose& stylus,
                           const Eigen::Vector3d& tip_in_sensor) {
  return {stylus.world_from_body * tip_in_sensor,
          std::hypot(stylus.position_deviation_m,
                     stylus.rotation_deviation_rad * tip_in_sensor.norm())};
}

Status PointRegistrationOptions::check() const {
  if (!(most_deviations > 0) || !(least_extent_m > 0)) {
    return fail(Errc::kInvalidOption,
                "registering points: most_deviations is {} and least_extent_m {}; both above 0",
                most_deviations,
                least_extent_m);
  }
  return {};
}

Result<PointRegistration> register_points(std::span<const PointPair> pairs,
                                          const PointRegistrationOptions& options) {
  VENEER_TRY(options.check());
  if (pairs.size() < kLeastPairs) {
    return fail(Errc::kInvalidOption,
                "registering points: {} pairs; touch at least {} points, better 6 to 10",
                pairs.size(),
                kLeastPairs);
  }
  std::vector<Eigen::Vector3d> all;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const PointPair& pair = pairs[i];
    if (!pair.x_in_a.allFinite() || !pair.x_in_b.allFinite() || !(pair.deviation_m > 0) ||
        !std::isfinite(pair.deviation_m)) {
      return fail(Errc::kInvalidOption,
                  "registering points: pair {} is no number, or its deviation of {} m not above 0",
                  i,
                  pair.deviation_m);
    }
    all.push_back(pair.x_in_a);
  }
  PointRegistration result;
  VENEER_TRY(check_extent(all, options, result.warnings));
  const auto start = least_median<RigidTransform>(
      pairs.size(),
      3,
      [&](std::span<const std::size_t> subset) { return rigid_fit(pairs, subset); },
      [&](const RigidTransform& b_from_a) { return distances_of(pairs, b_from_a); });
  if (!start) {
    return fail(Errc::kBadFormat, "registering points: the touched points lie on a line");
  }
  result.b_from_a = *start;
  std::vector<std::size_t> used;
  for (int i = 0; i < kRefits; ++i) {
    const Agreement agreement =
        agreement_of(distances_of(pairs, result.b_from_a), kUsualMedian, options.most_deviations);
    result.inlier = agreement.inlier;
    used = indices_of(agreement.inlier);
    if (used.size() < kLeastPairs || 2 * used.size() <= pairs.size()) {
      return fail(Errc::kBadFormat,
                  "registering points: only {} of {} pairs agree on a pose; check that they are in "
                  "the same order on both sides and in metres, and that nothing moved",
                  used.size(),
                  pairs.size());
    }
    const auto fit = rigid_fit(pairs, used);
    if (fit) result.b_from_a = *fit;
  }
  std::vector<Eigen::Vector3d> kept;
  for (const std::size_t i : used) kept.push_back(pairs[i].x_in_a);
  result.warnings.clear();
  VENEER_TRY(check_extent(kept, options, result.warnings));

  double squares = 0;
  for (const PointPair& pair : pairs)
    result.distance_m.push_back((result.b_from_a * pair.x_in_a - pair.x_in_b).norm());
  for (const std::size_t i : used) squares += result.distance_m[i] * result.distance_m[i];
  result.rms_m = std::sqrt(squares / static_cast<double>(used.size()));
  double held_out = 0;
  int predicted = 0;
  for (const std::size_t out : used) {
    std::vector<std::size_t> rest = used;
    std::erase(rest, out);
    const auto fit = rigid_fit(pairs, rest);
    if (!fit) continue;
    held_out += (*fit * pairs[out].x_in_a - pairs[out].x_in_b).squaredNorm();
    ++predicted;
  }
  result.held_out_m = predicted > 0 ? std::sqrt(held_out / predicted) : 0;
  fill_deviations(pairs, used, result);
  if (used.size() < pairs.size()) {
    result.warnings.push_back(fmt::format(
        "{} of {} pairs are far off and were left out", pairs.size() - used.size(), pairs.size()));
  }
  return result;
}

}  // namespace veneer::geometry
