// SPDX-License-Identifier: Apache-2.0
#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "calibration/geometry/internal_ceres.h"
#include "calibration/geometry/internal_joint_fit.h"
#include "calibration/geometry/internal_pose_block.h"
#include "calibration/geometry/internal_projection.h"

namespace veneer::geometry {
namespace {

constexpr int kLensSize = 9;
using LensBlock = std::array<double, kLensSize>;  // fx fy cx cy k1 k2 p1 p2 k3

Lens lens_of(const LensBlock& b) { return {b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8]}; }

/// The coefficients that stay where they are.
std::vector<int> fixed_of(LensModel model) {
  switch (model) {
    case LensModel::kPinhole:
      return {4, 5, 6, 7, 8};
    case LensModel::kRadial:
      return {6, 7, 8};
    case LensModel::kFull:
      return {};
  }
  return {};
}

template <class T>
void transform(const T* pose, const T* point, T* out) {
  ceres::AngleAxisRotatePoint(pose, point, out);
  for (int i = 0; i < 3; ++i) out[i] += pose[3 + i];
}

template <class T>
bool lens_residual(const T* lens, const T* point, const Eigen::Vector2d& seen, T* residual) {
  if (!project_with(lens, point, residual)) return false;
  residual[0] -= seen.x();
  residual[1] -= seen.y();
  return true;
}

struct CameraResidual {
  Eigen::Vector3d point;
  Eigen::Vector2d seen;

  template <class T>
  bool operator()(const T* camera_from_object, const T* lens, T* residual) const {
    const T x[3] = {T(point.x()), T(point.y()), T(point.z())};
    T in_camera[3];
    transform(camera_from_object, x, in_camera);
    return lens_residual(lens, in_camera, seen, residual);
  }
};

struct ProjectorResidual {
  Eigen::Vector3d point;
  Eigen::Vector2d seen;

  template <class T>
  bool operator()(const T* camera_from_object,
                  const T* projector_from_camera,
                  const T* lens,
                  T* residual) const {
    const T x[3] = {T(point.x()), T(point.y()), T(point.z())};
    T in_camera[3];
    T in_projector[3];
    transform(camera_from_object, x, in_camera);
    transform(projector_from_camera, in_camera, in_projector);
    return lens_residual(lens, in_projector, seen, residual);
  }
};

/// The unknowns as blocks, and the sum of squares over them.
class JointProblem {
 public:
  JointProblem(std::span<const View> views, const FitModel& model, const Estimate& estimate)
      : camera_(estimate.rig.camera.coefficients()),
        projector_(estimate.rig.projector.coefficients()),
        rig_(block_of(estimate.rig.projector_from_camera)) {
    for (const RigidTransform& pose : estimate.camera_from_object) poses_.push_back(block_of(pose));
    add_blocks(model);
    for (std::size_t v = 0; v < views.size(); ++v) add_view(views[v], model, poses_[v]);
  }

  FitOutcome solve() {
    ceres::Solver::Options options = tight_options();
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (PoseBlock& pose : poses_)
      options.linear_solver_ordering->AddElementToGroup(pose.data(), 0);
    for (double* block : shared_) options.linear_solver_ordering->AddElementToGroup(block, 1);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    return {static_cast<int>(summary.iterations.size()), summary.IsSolutionUsable()};
  }

  void read_into(Estimate& estimate) const {
    estimate.rig = {lens_of(camera_), lens_of(projector_), pose_of(rig_)};
    for (std::size_t v = 0; v < poses_.size(); ++v)
      estimate.camera_from_object[v] = pose_of(poses_[v]);
  }

  /// At where the blocks are.
  [[nodiscard]] std::optional<Deviations> deviations() {
    const std::optional<double> variance = variance_of(problem_);
    const auto blocks = geometry::deviations_of(problem_, {shared_.begin(), shared_.end()});
    if (!variance || !blocks) return std::nullopt;
    const double scale = std::sqrt(*variance);
    const auto lens_deviations = [&](const std::vector<double>& d) {
      return LensDeviations{scale * d[0],
                            scale * d[1],
                            scale * d[2],
                            scale * d[3],
                            scale * d[4],
                            scale * d[5],
                            scale * d[6],
                            scale * d[7],
                            scale * d[8]};
    };
    Deviations result;
    result.camera = lens_deviations(blocks->front());
    if (shared_.size() > 1) {
      result.projector = lens_deviations((*blocks)[1]);
      const std::vector<double>& d = (*blocks)[2];
      result.rotation_rad = scale * Eigen::Vector3d(d[0], d[1], d[2]);
      result.translation = scale * Eigen::Vector3d(d[3], d[4], d[5]);
    }
    return result;
  }

 private:
  void add_lens(LensBlock& lens, LensModel model) {
    problem_.AddParameterBlock(lens.data(), kLensSize);
    const std::vector<int> fixed = fixed_of(model);
    if (!fixed.empty())
      problem_.SetManifold(lens.data(), new ceres::SubsetManifold(kLensSize, fixed));
    shared_.push_back(lens.data());
  }

  void add_blocks(const FitModel& model) {
    add_lens(camera_, model.camera_model);
    if (model.use_projector) {
      add_lens(projector_, model.projector_model);
      problem_.AddParameterBlock(rig_.data(), 6);
      shared_.push_back(rig_.data());
    }
    for (PoseBlock& pose : poses_) problem_.AddParameterBlock(pose.data(), 6);
    if (model.moving == Moving::kViews) {
      for (double* block : shared_) problem_.SetParameterBlockConstant(block);
    }
    if (model.moving == Moving::kProjector) {
      problem_.SetParameterBlockConstant(camera_.data());
      for (PoseBlock& pose : poses_) problem_.SetParameterBlockConstant(pose.data());
    }
  }

  /// Owned by the problem.
  static ceres::LossFunction* make_loss(const FitModel& model) {
    switch (model.loss) {
      case Loss::kNone:
        return nullptr;
      case Loss::kHuber:
        return new ceres::HuberLoss(model.loss_px);
      case Loss::kCauchy:
        return new ceres::CauchyLoss(model.loss_px);
    }
    return nullptr;
  }

  void add_view(const View& view, const FitModel& model, PoseBlock& pose) {
    for (std::size_t i = 0; i < view.x_in_object.size(); ++i) {
      if (view.camera[i].allFinite()) {
        problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<CameraResidual, 2, 6, kLensSize>(
                                      new CameraResidual{view.x_in_object[i], view.camera[i]}),
                                  make_loss(model),
                                  pose.data(),
                                  camera_.data());
      }
      if (model.use_projector && view.projector[i].allFinite()) {
        problem_.AddResidualBlock(
            new ceres::AutoDiffCostFunction<ProjectorResidual, 2, 6, 6, kLensSize>(
                new ProjectorResidual{view.x_in_object[i], view.projector[i]}),
            make_loss(model),
            pose.data(),
            rig_.data(),
            projector_.data());
      }
    }
  }

  LensBlock camera_;
  LensBlock projector_;
  PoseBlock rig_;
  std::vector<PoseBlock> poses_;
  std::vector<double*> shared_;  // blocks that all views look at
  ceres::Problem problem_;       // refers to the blocks above
};

double rms_of(double squares, int points) { return points > 0 ? std::sqrt(squares / points) : 0; }

}  // namespace

FitOutcome fit_jointly(std::span<const View> views, const FitModel& model, Estimate& estimate) {
  JointProblem problem(views, model, estimate);
  const FitOutcome outcome = problem.solve();
  if (outcome.solved) problem.read_into(estimate);
  return outcome;
}

std::optional<Deviations> deviations_at(std::span<const View> views,
                                        const FitModel& model,
                                        const Estimate& estimate) {
  return JointProblem(views, model, estimate).deviations();
}

Errors errors_of(const View& view,
                 const Rig& rig,
                 const RigidTransform& camera_from_object,
                 double outlier_px) {
  Errors errors;
  const RigidTransform projector_from_object = rig.projector_from_camera * camera_from_object;
  for (std::size_t i = 0; i < view.x_in_object.size(); ++i) {
    if (view.camera[i].allFinite()) {
      const double square =
          (rig.camera.project(camera_from_object * view.x_in_object[i]) - view.camera[i])
              .squaredNorm();
      errors.camera_squares += square;
      ++errors.camera_points;
      if (!(square <= outlier_px * outlier_px)) ++errors.outliers;
    }
    if (view.projector[i].allFinite()) {
      const double square =
          (rig.projector.project(projector_from_object * view.x_in_object[i]) - view.projector[i])
              .squaredNorm();
      errors.projector_squares += square;
      ++errors.projector_points;
      if (!(square <= outlier_px * outlier_px)) ++errors.outliers;
    }
  }
  return errors;
}

Errors errors_of(std::span<const View> views, const Estimate& estimate) {
  Errors errors;
  const double none = std::numeric_limits<double>::infinity();
  for (std::size_t v = 0; v < views.size(); ++v)
    errors.add(errors_of(views[v], estimate.rig, estimate.camera_from_object[v], none));
  return errors;
}

void Errors::add(const Errors& other) {
  camera_squares += other.camera_squares;
  projector_squares += other.projector_squares;
  camera_points += other.camera_points;
  projector_points += other.projector_points;
  outliers += other.outliers;
}

double Errors::camera_rms() const { return rms_of(camera_squares, camera_points); }
double Errors::projector_rms() const { return rms_of(projector_squares, projector_points); }
double Errors::stereo_rms() const {
  return rms_of(camera_squares + projector_squares, camera_points + projector_points);
}

FitModel joint_model(const GeometryOptions& options) {
  return {options.camera_model,
          options.projector_model,
          true,
          Moving::kAll,
          options.loss,
          options.loss_px};
}

}  // namespace veneer::geometry
