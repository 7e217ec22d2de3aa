// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/tied_registration.h"

#include <ceres/rotation.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "calibration/geometry/internal_ceres.h"
#include "calibration/geometry/internal_pose_block.h"
#include "calibration/geometry/internal_projection.h"

namespace veneer::geometry {
namespace {

constexpr std::size_t kLeastPoses = 4;
/// Deviations beyond which a touch counts linearly only.
constexpr double kHuber = 2.5;
/// A tracker that says nothing of its noise, or too little, is not perfect.
constexpr double kLeastPosition_m = 1e-5;
constexpr double kLeastRotation_rad = 1e-5;

/// The two frames as unknowns, turned round so that no inverse is needed.
struct Unknowns {
  PoseBlock projector_from_world;
  PoseBlock sensor_from_board;
};

/// Rotation vector, translation.
template <class T>
void transform(const T* pose, const T* in, T* out) {
  ceres::AngleAxisRotatePoint(pose, in, out);
  for (int i = 0; i < 3; ++i) out[i] += pose[3 + i];
}

/// One point of the board: where it is seen less where it should be, in deviations.
struct PointResidual {
  Eigen::Vector3d point;
  Eigen::Vector2d pixel;
  const RigidTransform* world_from_sensor;
  const std::array<double, 9>* lens;
  double deviation_px;

  template <class T>
  bool operator()(const T* projector_from_world,
                  const T* sensor_from_board,
                  const T* error,
                  T* residual) const {
    const T in_board[3] = {T(point.x()), T(point.y()), T(point.z())};
    T in_sensor[3];
    transform(sensor_from_board, in_board, in_sensor);
    T corrected[3];
    transform(error, in_sensor, corrected);
    const Eigen::Quaterniond& r = world_from_sensor->rotation;
    const T q[4] = {T(r.w()), T(r.x()), T(r.y()), T(r.z())};
    T in_world[3];
    ceres::QuaternionRotatePoint(q, corrected, in_world);
    for (int i = 0; i < 3; ++i) in_world[i] += T(world_from_sensor->translation[i]);
    T in_projector[3];
    transform(projector_from_world, in_world, in_projector);
    T seen[2];
    if (!project_with(lens->data(), in_projector, seen)) return false;
    residual[0] = (seen[0] - T(pixel.x())) / T(deviation_px);
    residual[1] = (seen[1] - T(pixel.y())) / T(deviation_px);
    return true;
  }
};

/// A touched cross-hair: where it would be seen less where it was shown, in deviations.
struct TouchResidual {
  const PixelTouch* touch;
  const std::array<double, 9>* lens;
  double deviation_px;

  template <class T>
  bool operator()(const T* projector_from_world, T* residual) const {
    const Eigen::Vector3d& x = touch->x_in_world;
    const T in_world[3] = {T(x.x()), T(x.y()), T(x.z())};
    T in_projector[3];
    transform(projector_from_world, in_world, in_projector);
    T seen[2];
    if (!project_with(lens->data(), in_projector, seen)) return false;
    residual[0] = (seen[0] - T(touch->pixel.x())) / T(deviation_px);
    residual[1] = (seen[1] - T(touch->pixel.y())) / T(deviation_px);
    return true;
  }
};

/// The tracker's error in its own deviations.
struct ErrorResidual {
  double rotation_rad;
  double position_m;
  template <class T>
  bool operator()(const T* error, T* residual) const {
    for (int i = 0; i < 3; ++i) residual[i] = error[i] / T(rotation_rad);
    for (int i = 3; i < 6; ++i) residual[i] = error[i] / T(position_m);
    return true;
  }
};

class Fit {
 public:
  Fit(std::span<const View> views,
      std::span<const tracking::SynchronisedPose> sensors,
      std::span<const PixelTouch> touches,
      const Lens& lens,
      const TiedOptions& options)
      : views_(views),
        sensors_(sensors),
        touches_(touches),
        lens_(lens.coefficients()),
        options_(options) {}

  /// Over the poses named by `used`.   @param result  where given, its deviations are filled in.
  Status refine(std::span<const std::size_t> used, Unknowns& unknowns, TiedRegistration* result) {
    std::vector<PoseBlock> errors(used.size(), PoseBlock{});
    ceres::Problem problem;
    for (std::size_t k = 0; k < used.size(); ++k) {
      const View& view = views_[used[k]];
      const tracking::SynchronisedPose& sensor = sensors_[used[k]];
      for (std::size_t i = 0; i < view.projector.size(); ++i) {
        if (!view.projector[i].allFinite()) continue;
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PointResidual, 2, 6, 6, 6>(
                                     new PointResidual{view.x_in_object[i],
                                                       view.projector[i],
                                                       &sensor.world_from_body,
                                                       &lens_,
                                                       options_.pixel_deviation_px}),
                                 nullptr,
                                 unknowns.projector_from_world.data(),
                                 unknowns.sensor_from_board.data(),
                                 errors[k].data());
      }
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ErrorResidual, 6, 6>(
              new ErrorResidual{std::max(sensor.rotation_deviation_rad, kLeastRotation_rad),
                                std::max(sensor.position_deviation_m, kLeastPosition_m)}),
          nullptr,
          errors[k].data());
    }
    const RigidTransform projector_from_world = pose_of(unknowns.projector_from_world);
    for (const PixelTouch& touch : touches_) {
      const double distance = std::max((projector_from_world * touch.x_in_world).z(), 1e-6);
      const double deviation =
          std::hypot(options_.touch_deviation_px, lens_[0] * touch.deviation_m / distance);
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<TouchResidual, 2, 6>(
                                   new TouchResidual{&touch, &lens_, deviation}),
                               new ceres::HuberLoss(kHuber),
                               unknowns.projector_from_world.data());
    }
    // Micrometres are enough here, and the last digits of so many unknowns cannot be had.
    ceres::Solver::Options solver = tight_options();
    solver.function_tolerance = 1e-12;
    solver.parameter_tolerance = 1e-10;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (!summary.IsSolutionUsable())
      return fail(
          Errc::kBadFormat,
          "tying the registration to the pixels: the fit does not end; does the board lie in "
          "front of the projector, and are all lengths in metres?");
    if (result == nullptr) return {};
    const double scale = std::sqrt(std::max(1.0, variance_of(problem).value_or(1)));
    if (const auto deviations = deviations_of(problem, {unknowns.projector_from_world.data()})) {
      const std::vector<double>& d = deviations->front();
      result->rotation_deviation_rad = scale * std::max({d[0], d[1], d[2]});
      // The origin in the world is -R^T t: the shift's deviation and the turning's lever.
      const double lever = Eigen::Vector3d(unknowns.projector_from_world[3],
                                           unknowns.projector_from_world[4],
                                           unknowns.projector_from_world[5])
                               .norm();
      result->position_deviation_m =
          std::hypot(scale * std::max({d[3], d[4], d[5]}), lever * result->rotation_deviation_rad);
    }
    return {};
  }

  [[nodiscard]] double touch_rms(const Unknowns& unknowns) const {
    const RigidTransform projector_from_world = pose_of(unknowns.projector_from_world);
    double squares = 0;
    for (const PixelTouch& touch : touches_) {
      const Eigen::Vector3d x = projector_from_world * touch.x_in_world;
      Eigen::Vector2d pixel;
      if (project_with(lens_.data(), x.data(), pixel.data()))
        squares += (pixel - touch.pixel).squaredNorm();
    }
    return touches_.empty() ? 0 : std::sqrt(squares / static_cast<double>(touches_.size()));
  }

  /// Sum of squared distances of a pose's points from where the tracker's pose alone puts them, and
  /// their number.
  [[nodiscard]] std::pair<double, int> distances(std::size_t pose, const Unknowns& unknowns) const {
    const RigidTransform projector_from_board = pose_of(unknowns.projector_from_world) *
                                                sensors_[pose].world_from_body *
                                                pose_of(unknowns.sensor_from_board);
    double squares = 0;
    int count = 0;
    const View& view = views_[pose];
    for (std::size_t i = 0; i < view.projector.size(); ++i) {
      const Eigen::Vector3d x = projector_from_board * view.x_in_object[i];
      Eigen::Vector2d pixel;
      if (!view.projector[i].allFinite() || !project_with(lens_.data(), x.data(), pixel.data()))
        continue;
      squares += (pixel - view.projector[i]).squaredNorm();
      ++count;
    }
    return {squares, count};
  }

 private:
  std::span<const View> views_;
  std::span<const tracking::SynchronisedPose> sensors_;
  std::span<const PixelTouch> touches_;
  std::array<double, 9> lens_;
  const TiedOptions& options_;
};

double root_mean(double squares, int count) { return count > 0 ? std::sqrt(squares / count) : 0; }

}  // namespace

Status TiedOptions::check() const {
  if (pixel_deviation_px > 0 && std::isfinite(pixel_deviation_px)) return {};
  return fail(
      Errc::kInvalidOption,
      "tying the registration to the pixels: pixel_deviation_px is {}; it has to be above 0",
      pixel_deviation_px);
}

Result<TiedRegistration> tie_registration(std::span<const View> views,
                                          std::span<const tracking::SynchronisedPose> sensors,
                                          const Lens& lens,
                                          const BoardRegistration& start,
                                          std::span<const PixelTouch> touches,
                                          const TiedOptions& options) {
  VENEER_TRY(options.check());
  if (views.size() != sensors.size() || views.size() != start.inlier.size())
    return fail(
        Errc::kInvalidOption,
        "tying the registration to the pixels: {} views, {} tracked poses and {} registered "
        "ones; there must be as many of each",
        views.size(),
        sensors.size(),
        start.inlier.size());
  for (const PixelTouch& touch : touches) {
    if (!touch.pixel.allFinite() || !touch.x_in_world.allFinite() || !(touch.deviation_m >= 0))
      return fail(Errc::kInvalidOption,
                  "tying the registration to the pixels: a touch has a value that is no number");
  }
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (start.inlier[i]) used.push_back(i);
  if (used.size() < kLeastPoses)
    return fail(Errc::kBadFormat,
                "tying the registration to the pixels: {} poses; at least {} are needed",
                used.size(),
                kLeastPoses);
  Fit fit(views, sensors, touches, lens, options);
  Unknowns unknowns{block_of(start.world_from_projector.inverse()),
                    block_of(start.board_from_sensor.inverse())};
  TiedRegistration result;
  VENEER_TRY(fit.refine(used, unknowns, &result));
  result.world_from_projector = pose_of(unknowns.projector_from_world).inverse();
  result.board_from_sensor = pose_of(unknowns.sensor_from_board).inverse();

  double squares = 0;
  double held_out = 0;
  int count = 0;
  int held_out_count = 0;
  for (const std::size_t out : used) {
    const auto [own, points] = fit.distances(out, unknowns);
    squares += own;
    count += points;
    std::vector<std::size_t> rest(used);
    std::erase(rest, out);
    Unknowns others = unknowns;
    VENEER_TRY(fit.refine(rest, others, nullptr));
    const auto [predicted, predicted_points] = fit.distances(out, others);
    held_out += predicted;
    held_out_count += predicted_points;
  }
  if (count == 0)
    return fail(Errc::kBadFormat,
                "tying the registration to the pixels: no point of the board has a pixel");
  result.rms_px = root_mean(squares, count);
  result.touch_rms_px = fit.touch_rms(unknowns);
  result.held_out_px = root_mean(held_out, held_out_count);
  return result;
}

}  // namespace veneer::geometry
