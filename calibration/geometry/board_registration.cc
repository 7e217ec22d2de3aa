// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>

#include "base/units.h"
#include "calibration/geometry/internal_ceres.h"
#include "calibration/geometry/internal_consensus.h"
#include "calibration/geometry/internal_pose_block.h"
#include "calibration/geometry/registration.h"

namespace veneer::geometry {
namespace {

constexpr std::size_t kLeastPoses = 4;  // three make the poses, the fourth can contradict
/// Median of the larger of two lengths of vectors whose three coordinates are normal with
/// deviation 1.
constexpr double kUsualMedian = 1.93;
constexpr int kRefits = 4;  // after which the set of inliers does not change any more

/// What is sought.
struct Frames {
  RigidTransform world_from_projector;
  RigidTransform board_from_sensor;
};

struct PoseDeviations {
  double position_m = 0;
  double rotation_rad = 0;
};

PoseDeviations deviations_of(const BoardPose& pose, const BoardRegistrationOptions& options) {
  return {
      std::hypot(pose.world_from_sensor.position_deviation_m, options.position_deviation_m),
      std::hypot(pose.world_from_sensor.rotation_deviation_rad, options.rotation_deviation_rad)};
}

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& turn) {
  const Eigen::AngleAxisd angle_axis(turn);
  double angle = angle_axis.angle();
  if (angle > EIGEN_PI) angle -= 2 * EIGEN_PI;
  return angle * angle_axis.axis();
}

/// How far the tracker's pose is from the one that the frames predict.
struct PoseError {
  double position_m = 0;
  double rotation_rad = 0;
};
PoseError error_of(const BoardPose& pose, const Frames& frames) {
  const RigidTransform predicted =
      frames.world_from_projector * pose.projector_from_board * frames.board_from_sensor;
  const RigidTransform& seen = pose.world_from_sensor.world_from_body;
  return {(predicted.translation - seen.translation).norm(),
          rotation_vector(predicted.rotation.conjugate() * seen.rotation).norm()};
}

/// The nearest rotation to a matrix up to a factor, which may be negative.
Eigen::Matrix3d nearest_rotation(Eigen::Matrix3d matrix) {
  if (matrix.determinant() < 0) matrix = -matrix;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

/// From the poses named by `used`, in linear steps: W Y = Z P for the rotations, with Y the inverse
/// of the sensor's, and then the translations. Absent where the turnings leave a direction open.
std::optional<Frames> linear_fit(std::span<const BoardPose> poses,
                                 std::span<const std::size_t> used) {
  Eigen::Matrix<double, 18, 18> normal = Eigen::Matrix<double, 18, 18>::Zero();
  for (const std::size_t i : used) {
    const Eigen::Matrix3d w =
        poses[i].world_from_sensor.world_from_body.rotation.toRotationMatrix();
    const Eigen::Matrix3d p = poses[i].projector_from_board.rotation.toRotationMatrix();
    // Columns: Y by columns, then Z by columns; row (r, c) of W Y - Z P.
    Eigen::Matrix<double, 9, 18> rows = Eigen::Matrix<double, 9, 18>::Zero();
    for (int c = 0; c < 3; ++c) {
      rows.block<3, 3>(3 * c, 3 * c) = w;
      for (int k = 0; k < 3; ++k)
        rows.block<3, 3>(3 * c, 9 + 3 * k) = -p(k, c) * Eigen::Matrix3d::Identity();
    }
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 18, 18>> solver(normal);
  // Turnings about one axis leave a second direction open.
  constexpr double kLeastSecond = 1e-6;
  if (!(solver.eigenvalues()[1] > kLeastSecond * solver.eigenvalues()[17])) return std::nullopt;
  const Eigen::Matrix<double, 18, 1> solution = solver.eigenvectors().col(0);
  const Eigen::Matrix3d y = nearest_rotation(Eigen::Map<const Eigen::Matrix3d>(solution.data()));
  const Eigen::Matrix3d z =
      nearest_rotation(Eigen::Map<const Eigen::Matrix3d>(solution.data() + 9));
  Frames frames;
  frames.board_from_sensor.rotation = Eigen::Quaterniond(Eigen::Matrix3d(y.transpose()));
  frames.world_from_projector.rotation = Eigen::Quaterniond(z);

  Eigen::MatrixXd matrix(3 * used.size(), 6);
  Eigen::VectorXd right(3 * used.size());
  for (std::size_t k = 0; k < used.size(); ++k) {
    const BoardPose& pose = poses[used[k]];
    const auto row = static_cast<Eigen::Index>(3 * k);
    matrix.block<3, 3>(row, 0) = z * pose.projector_from_board.rotation.toRotationMatrix();
    matrix.block<3, 3>(row, 3) = Eigen::Matrix3d::Identity();
    right.segment<3>(row) = pose.world_from_sensor.world_from_body.translation -
                            z * pose.projector_from_board.translation;
  }
  const Eigen::VectorXd shifts = matrix.colPivHouseholderQr().solve(right);
  frames.board_from_sensor.translation = shifts.head<3>();
  frames.world_from_projector.translation = shifts.tail<3>();
  return frames;
}

/// Differences of the predicted and the tracked pose in their deviations.
struct BoardResidual {
  const BoardPose* pose;
  PoseDeviations deviations;

  template <class T>
  bool operator()(const T* world_from_projector, const T* board_from_sensor, T* residual) const {
    // Positions: the sensor's origin, through board and projector into the world.
    const T* in_board = board_from_sensor + 3;
    const RigidTransform& p = pose->projector_from_board;
    const T q[4] = {T(p.rotation.w()), T(p.rotation.x()), T(p.rotation.y()), T(p.rotation.z())};
    T in_projector[3];
    ceres::QuaternionRotatePoint(q, in_board, in_projector);
    for (int i = 0; i < 3; ++i) in_projector[i] += T(p.translation[i]);
    T in_world[3];
    ceres::AngleAxisRotatePoint(world_from_projector, in_projector, in_world);
    const RigidTransform& seen = pose->world_from_sensor.world_from_body;
    for (int i = 0; i < 3; ++i)
      residual[i] = (in_world[i] + world_from_projector[3 + i] - T(seen.translation[i])) /
                    T(deviations.position_m);
    // Turnings.
    T z[4];
    T x[4];
    ceres::AngleAxisToQuaternion(world_from_projector, z);
    ceres::AngleAxisToQuaternion(board_from_sensor, x);
    T zp[4];
    T predicted[4];
    ceres::QuaternionProduct(z, q, zp);
    ceres::QuaternionProduct(zp, x, predicted);
    const Eigen::Quaterniond back = seen.rotation.conjugate();
    const T b[4] = {T(back.w()), T(back.x()), T(back.y()), T(back.z())};
    T difference[4];
    ceres::QuaternionProduct(b, predicted, difference);
    T turn[3];
    ceres::QuaternionToAngleAxis(difference, turn);
    for (int i = 0; i < 3; ++i) residual[3 + i] = turn[i] / T(deviations.rotation_rad);
    return true;
  }
};

/// Refines `frames` over the poses named by `used`.
/// @param result  where given, its deviations are filled in.
void refine(std::span<const BoardPose> poses,
            std::span<const std::size_t> used,
            const BoardRegistrationOptions& options,
            Frames& frames,
            BoardRegistration* result) {
  PoseBlock z = block_of(frames.world_from_projector);
  PoseBlock x = block_of(frames.board_from_sensor);
  ceres::Problem problem;
  for (const std::size_t i : used) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<BoardResidual, 6, 6, 6>(
                                 new BoardResidual{&poses[i], deviations_of(poses[i], options)}),
                             nullptr,
                             z.data(),
                             x.data());
  }
  ceres::Solver::Summary summary;
  ceres::Solve(tight_options(), &problem, &summary);
  if (!summary.IsSolutionUsable()) return;
  frames.world_from_projector = pose_of(z);
  frames.board_from_sensor = pose_of(x);
  if (result == nullptr) return;
  // Deviations that were stated too small do not make the answer better than it is.
  const double scale = std::sqrt(std::max(1.0, variance_of(problem).value_or(1)));
  const auto deviations = geometry::deviations_of(problem, {z.data()});
  if (!deviations) return;
  const std::vector<double>& d = deviations->front();
  result->rotation_deviation_rad = scale * std::max({d[0], d[1], d[2]});
  result->position_deviation_m = scale * std::max({d[3], d[4], d[5]});
}

std::vector<double> distances_of(std::span<const BoardPose> poses,
                                 const Frames& frames,
                                 const BoardRegistrationOptions& options) {
  std::vector<double> distances;
  for (const BoardPose& pose : poses) {
    const PoseError error = error_of(pose, frames);
    const PoseDeviations deviations = deviations_of(pose, options);
    distances.push_back(std::max(error.position_m / deviations.position_m,
                                 error.rotation_rad / deviations.rotation_rad));
  }
  return distances;
}

/// The turnings between the poses must be about two axes; the equations are else the same for every
/// place along the one axis. (Tsai and Lenz 1989, "A New Technique for Fully Autonomous and
/// Efficient 3D Robotics Hand/Eye Calibration".)
Status check_turnings(std::span<const BoardPose> poses,
                      std::span<const std::size_t> used,
                      const BoardRegistrationOptions& options) {
  std::vector<Eigen::Vector3d> turns;
  for (const std::size_t i : used) {
    for (const std::size_t j : used) {
      if (j <= i) continue;
      turns.push_back(rotation_vector(poses[i].projector_from_board.rotation *
                                      poses[j].projector_from_board.rotation.conjugate()));
    }
  }
  const auto largest = std::ranges::max_element(turns, {}, &Eigen::Vector3d::norm);
  const double most = largest == turns.end() ? 0 : largest->norm();
  double second = 0;
  for (const Eigen::Vector3d& turn : turns) {
    if (most > 0) second = std::max(second, largest->cross(turn).norm() / most);
  }
  const double least = to_radians(Degrees{options.least_turn_deg}).value;
  if (most >= least && second >= least) return {};
  return fail(
      Errc::kBadFormat,
      "registering boards: between the poses the board turns by at most {:.1f} degrees about "
      "one axis and {:.1f} about a second one; both have to reach {:.0f}, or else it stays "
      "open where along the axis the sensor sits. Turn the board about the vertical and "
      "about the horizontal",
      to_degrees(Radians{most}).value,
      to_degrees(Radians{second}).value,
      options.least_turn_deg);
}

bool finite(const RigidTransform& pose) {
  return pose.translation.allFinite() && pose.rotation.coeffs().allFinite();
}

Status check_poses(std::span<const BoardPose> poses) {
  if (poses.size() < kLeastPoses) {
    return fail(Errc::kInvalidOption,
                "registering boards: {} poses; at least {} are needed, better 8 to 15",
                poses.size(),
                kLeastPoses);
  }
  for (const BoardPose& pose : poses) {
    if (!finite(pose.projector_from_board) || !finite(pose.world_from_sensor.world_from_body) ||
        !std::isfinite(pose.world_from_sensor.position_deviation_m) ||
        !std::isfinite(pose.world_from_sensor.rotation_deviation_rad)) {
      return fail(Errc::kInvalidOption,
                  "registering boards: pose {} has a value that is no number",
                  pose.name);
    }
  }
  return {};
}

/// Errors of all poses, and how well each inlier is predicted by the others.
void fill_errors(std::span<const BoardPose> poses,
                 std::span<const std::size_t> used,
                 const BoardRegistrationOptions& options,
                 const Frames& frames,
                 BoardRegistration& result) {
  for (const BoardPose& pose : poses) {
    const PoseError error = error_of(pose, frames);
    result.position_error_m.push_back(error.position_m);
    result.rotation_error_rad.push_back(error.rotation_rad);
  }
  PoseError squares;
  PoseError held_out;
  const auto add = [](PoseError& sum, const PoseError& error) {
    sum.position_m += error.position_m * error.position_m;
    sum.rotation_rad += error.rotation_rad * error.rotation_rad;
  };
  for (const std::size_t out : used) {
    add(squares, error_of(poses[out], frames));
    std::vector<std::size_t> rest(used.begin(), used.end());
    std::erase(rest, out);
    Frames others = frames;
    refine(poses, rest, options, others, nullptr);
    add(held_out, error_of(poses[out], others));
  }
  const auto count = static_cast<double>(used.size());
  result.position_rms_m = std::sqrt(squares.position_m / count);
  result.rotation_rms_rad = std::sqrt(squares.rotation_rad / count);
  result.held_out_position_m = std::sqrt(held_out.position_m / count);
  result.held_out_rotation_rad = std::sqrt(held_out.rotation_rad / count);
}

}  // namespace

Status BoardRegistrationOptions::check() const {
  if (!(position_deviation_m > 0) || !(rotation_deviation_rad > 0) || !(most_deviations > 0) ||
      !(least_turn_deg > 0)) {
    return fail(Errc::kInvalidOption,
                "registering boards: position_deviation_m is {}, rotation_deviation_rad {}, "
                "most_deviations {} and least_turn_deg {}; all have to be above 0",
                position_deviation_m,
                rotation_deviation_rad,
                most_deviations,
                least_turn_deg);
  }
  return {};
}

Result<BoardRegistration> register_boards(std::span<const BoardPose> poses,
                                          const BoardRegistrationOptions& options) {
  VENEER_TRY(options.check());
  VENEER_TRY(check_poses(poses));
  std::vector<std::size_t> used(poses.size());
  for (std::size_t i = 0; i < used.size(); ++i) used[i] = i;
  VENEER_TRY(check_turnings(poses, used, options));
  std::optional<Frames> frames = least_median<Frames>(
      poses.size(),
      3,
      [&](std::span<const std::size_t> subset) { return linear_fit(poses, subset); },
      [&](const Frames& each) { return distances_of(poses, each, options); });
  if (!frames) {
    return fail(Errc::kBadFormat,
                "registering boards: no three poses turn about two axes; turn the board about the "
                "vertical and about the horizontal");
  }
  BoardRegistration result;
  for (int i = 0; i < kRefits; ++i) {
    const Agreement agreement =
        agreement_of(distances_of(poses, *frames, options), kUsualMedian, options.most_deviations);
    result.inlier = agreement.inlier;
    used.clear();
    for (std::size_t k = 0; k < poses.size(); ++k)
      if (agreement.inlier[k]) used.push_back(k);
    if (used.size() < kLeastPoses || 2 * used.size() <= poses.size()) {
      return fail(
          Errc::kBadFormat,
          "registering boards: only {} of {} poses agree; check that the sensor is fixed to "
          "the board, that board and tracker were read at the same moments, that lengths "
          "are in metres, and that the board does not look the same after half a turn",
          used.size(),
          poses.size());
    }
    refine(poses, used, options, *frames, &result);
  }
  VENEER_TRY(check_turnings(poses, used, options));
  result.world_from_projector = frames->world_from_projector;
  result.board_from_sensor = frames->board_from_sensor;
  fill_errors(poses, used, options, *frames, result);
  if (used.size() < poses.size()) {
    result.warnings.push_back(fmt::format(
        "{} of {} poses are far off and were left out", poses.size() - used.size(), poses.size()));
  }
  return result;
}

}  // namespace veneer::geometry
