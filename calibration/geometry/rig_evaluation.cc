// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "calibration/geometry/internal_joint_fit.h"

namespace veneer::geometry {
namespace {

constexpr int kLeastPoints = 6;  // of a view, for its pose
constexpr std::size_t kLeastViews = 3;

int seen(std::span<const Eigen::Vector2d> pixels) {
  return static_cast<int>(std::ranges::count_if(
      pixels, [](const Eigen::Vector2d& pixel) { return pixel.allFinite(); }));
}

}  // namespace

Status check_views(std::span<const View> views) {
  if (views.size() < kLeastViews) {
    return fail(Errc::kInvalidOption,
                "calibrating the geometry: {} pose{}; at least {} are needed, better 5 to 10, with "
                "the board tilted differently in each",
                views.size(),
                views.size() == 1 ? "" : "s",
                kLeastViews);
  }
  for (const View& view : views) {
    const std::size_t count = view.x_in_object.size();
    if (view.camera.size() != count || view.projector.size() != count) {
      return fail(Errc::kInvalidOption,
                  "calibrating the geometry: pose {} has {} points, but {} camera and {} projector "
                  "pixels; give one of each a point, NaN where it is not seen",
                  view.name,
                  count,
                  view.camera.size(),
                  view.projector.size());
    }
    const bool finite = std::ranges::all_of(
        view.x_in_object, [](const Eigen::Vector3d& point) { return point.allFinite(); });
    if (!finite) {
      return fail(Errc::kInvalidOption,
                  "calibrating the geometry: pose {} has a point of the object that is no number",
                  view.name);
    }
    const int camera_points = seen(view.camera);
    const int projector_points = seen(view.projector);
    if (std::min(camera_points, projector_points) < kLeastPoints) {
      return fail(
          Errc::kInvalidOption,
          "calibrating the geometry: pose {} has {} points that the camera sees and {} that "
          "the projector lights; {} of each are needed: leave the pose out, or take it "
          "again where both reach the board",
          view.name,
          camera_points,
          projector_points,
          kLeastPoints);
    }
  }
  return {};
}

Result<RigEvaluation> evaluate_rig(const Rig& rig,
                                   std::span<const View> views,
                                   const GeometryOptions& options) {
  VENEER_TRY(options.check());
  VENEER_TRY(check_views(views));
  Estimate estimate{rig, {}};
  for (const View& view : views) {
    const auto pose = pose_of(view.x_in_object, view.camera, rig.camera);
    if (!pose) {
      return fail(
          Errc::kBadFormat,
          "evaluating a result: its camera does not explain the points of pose {}; it is of "
          "another camera, or its size is another",
          view.name);
    }
    estimate.camera_from_object.push_back(*pose);
  }
  // As many coefficients as the result has, so that it can only gain.
  const auto model_of = [](const Lens& lens) {
    if (lens.k3 != 0 || lens.p1 != 0 || lens.p2 != 0) return LensModel::kFull;
    return lens.k1 != 0 || lens.k2 != 0 ? LensModel::kRadial : LensModel::kPinhole;
  };
  FitModel model = joint_model(options);
  model.camera_model = model_of(rig.camera);
  model.projector_model = model_of(rig.projector);
  model.moving = Moving::kViews;
  fit_jointly(views, model, estimate);
  const Errors before = errors_of(views, estimate);
  RigEvaluation evaluation;
  evaluation.stereo_rms_px = before.stereo_rms();
  evaluation.camera_rms_px = before.camera_rms();
  evaluation.projector_rms_px = before.projector_rms();
  model.moving = Moving::kAll;
  if (!std::isfinite(evaluation.stereo_rms_px) || !fit_jointly(views, model, estimate).solved) {
    return fail(Errc::kBadFormat,
                "evaluating a result: its projector and camera put points behind a lens");
  }
  evaluation.optimum_rms_px = errors_of(views, estimate).stereo_rms();
  evaluation.focal_change = std::abs(estimate.rig.projector.fx / rig.projector.fx - 1);
  const RigidTransform& fitted = estimate.rig.projector_from_camera;
  evaluation.translation_change =
      (fitted.translation - rig.projector_from_camera.translation).norm() /
      fitted.translation.norm();
  constexpr double kSameRms = 1.01;
  evaluation.converged = evaluation.stereo_rms_px <= kSameRms * evaluation.optimum_rms_px;
  return evaluation;
}

}  // namespace veneer::geometry
