// SPDX-License-Identifier: Apache-2.0
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "calibration/geometry/internal_joint_fit.h"

namespace veneer::geometry {
namespace {

constexpr int kLensSize = 9;
using LensBlock = std::array<double, kLensSize>;  // fx fy cx cy k1 k2 p1 p2 k3
using PoseBlock = std::array<double, 6>;          // rotation vector, translation

LensBlock block_of(const Lens& lens) {
  return {lens.fx, lens.fy, lens.cx, lens.cy, lens.k1, lens.k2, lens.p1, lens.p2, lens.k3};
}

Lens lens_of(const LensBlock& b) { return {b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8]}; }

PoseBlock block_of(const RigidTransform& pose) {
  const Eigen::AngleAxisd turn(pose.rotation);
  const Eigen::Vector3d rotation = turn.angle() * turn.axis();
  const Eigen::Vector3d& t = pose.translation;
  return {rotation.x(), rotation.y(), rotation.z(), t.x(), t.y(), t.z()};
}

RigidTransform pose_of(const PoseBlock& b) {
  const Eigen::Vector3d rotation(b[0], b[1], b[2]);
  const double angle = rotation.norm();
  RigidTransform pose;
  if (angle > 0) pose.rotation = Eigen::AngleAxisd(angle, rotation / angle);
  pose.translation = {b[3], b[4], b[5]};
  return pose;
}

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

/// Lens::project for any number type, minus the pixel that was seen.
template <class T>
bool lens_residual(const T* lens, const T* point, const Eigen::Vector2d& seen, T* residual) {
  if (!(point[2] > T(0))) return false;
  const T x = point[0] / point[2];
  const T y = point[1] / point[2];
  const T r2 = x * x + y * y;
  const T radial = T(1) + r2 * (lens[4] + r2 * (lens[5] + r2 * lens[8]));
  const T dx = T(2) * lens[6] * x * y + lens[7] * (r2 + T(2) * x * x);
  const T dy = lens[6] * (r2 + T(2) * y * y) + T(2) * lens[7] * x * y;
  residual[0] = lens[0] * (x * radial + dx) + lens[2] - seen.x();
  residual[1] = lens[1] * (y * radial + dy) + lens[3] - seen.y();
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
      : camera_(block_of(estimate.rig.camera)),
        projector_(block_of(estimate.rig.projector)),
        rig_(block_of(estimate.rig.projector_from_camera)) {
    for (const RigidTransform& pose : estimate.camera_from_object) poses_.push_back(block_of(pose));
    add_blocks(model);
    for (std::size_t v = 0; v < views.size(); ++v) add_view(views[v], model, poses_[v]);
  }

  FitOutcome solve() {
    ceres::Solver::Options options;
    options.max_num_iterations = 1000;
    // As far as the arithmetic goes: the answer is to be the same whatever the start, and the
    // valley of focal length and distance is flat.
    options.function_tolerance = 1e-16;
    options.gradient_tolerance = 1e-16;
    options.parameter_tolerance = 1e-13;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.dense_linear_algebra_library_type = ceres::EIGEN;  // no BLAS, whichever it would be
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
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
    double cost = 0;
    problem_.Evaluate({}, &cost, nullptr, nullptr, nullptr);
    int unknowns = 0;
    std::vector<double*> blocks;
    problem_.GetParameterBlocks(&blocks);
    for (double* block : blocks) unknowns += problem_.ParameterBlockTangentSize(block);
    const int freedom = problem_.NumResiduals() - unknowns;
    if (freedom <= 0) return std::nullopt;
    const double variance = 2 * cost / freedom;

    ceres::Covariance::Options options;
    options.algorithm_type = ceres::SPARSE_QR;
    options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    options.num_threads = 1;
    ceres::Covariance covariance(options);
    std::vector<std::pair<const double*, const double*>> pairs;
    for (const double* block : shared_) pairs.emplace_back(block, block);
    if (!covariance.Compute(pairs, &problem_)) return std::nullopt;
    const auto deviations_of = [&](const double* block, int size) {
      std::vector<double> square(static_cast<std::size_t>(size * size), 0);
      std::vector<double> deviations(static_cast<std::size_t>(size), 0);
      // In the ambient space, rows of what is fixed are 0.
      if (!covariance.GetCovarianceBlock(block, block, square.data())) return deviations;
      for (int i = 0; i < size; ++i)
        deviations[static_cast<std::size_t>(i)] =
            std::sqrt(variance * std::max(0.0, square[static_cast<std::size_t>(i * size + i)]));
      return deviations;
    };
    const auto lens_deviations = [&](const LensBlock& lens) {
      const std::vector<double> d = deviations_of(lens.data(), kLensSize);
      return LensDeviations{d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7], d[8]};
    };
    Deviations result;
    result.camera = lens_deviations(camera_);
    if (shared_.size() > 1) {
      result.projector = lens_deviations(projector_);
      const std::vector<double> d = deviations_of(rig_.data(), 6);
      result.rotation_rad = {d[0], d[1], d[2]};
      result.translation = {d[3], d[4], d[5]};
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
