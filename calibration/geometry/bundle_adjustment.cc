// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/bundle_adjustment.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/units.h"
#include "calibration/geometry/internal_joint_fit.h"

namespace veneer::geometry {
namespace {

constexpr std::size_t kLeastOrientations = 3;
constexpr std::size_t kLeastForLeaveOneOut = 4;  // so that what remains can still be fitted
/// A focal length that is known worse than this part of it is worth a word, though not refused.
constexpr double kDoubtfulFocal = 0.01;
constexpr double kDoubtfulStart = 1e-6;  // two answers further apart than this are two answers
constexpr double kPlaneRatio = 1e-6;     // thickness of a plane, of its size: rounding alone
constexpr double kOutlierLosses = 3;     // as ViewQuality::outliers says

/// The normal of the plane of the points that the camera sees, in the object's frame; zero if they
/// are in no plane.
Eigen::Vector3d plane_normal(const View& view) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : view.x_in_object)
    middle += point / static_cast<double>(view.x_in_object.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : view.x_in_object)
    spread += (point - middle) * (point - middle).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread);
  const Eigen::Vector3d& values = solver.eigenvalues();
  if (values[0] > kPlaneRatio * values[2]) return Eigen::Vector3d::Zero();
  return solver.eigenvectors().col(0);
}

/// A plane tells a lens two equations, and a parallel one the same two again, however it lies in
/// itself. (Zhang 2000, "A Flexible New Technique for Camera Calibration", section 3.)
Status check_orientations(std::span<const View> views,
                          const Estimate& estimate,
                          const GeometryOptions& options) {
  std::vector<Eigen::Vector3d> distinct;
  double most_turn = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    Eigen::Vector3d normal = plane_normal(views[v]);
    if (normal.isZero()) return {};  // a solid tells all by itself
    normal = estimate.camera_from_object[v].rotation * normal;
    bool is_new = true;
    for (const Eigen::Vector3d& other : distinct) {
      const double turn = std::acos(std::min(1.0, std::abs(normal.dot(other))));
      most_turn = std::max(most_turn, turn);
      is_new = is_new && turn >= to_radians(Degrees{options.least_turn_deg}).value;
    }
    if (is_new) distinct.push_back(normal);
  }
  if (distinct.size() >= kLeastOrientations) return {};
  return fail(
      Errc::kBadFormat,
      "calibrating the geometry: the {} poses show the board in {} orientation{} only (they "
      "turn by at most {:.1f} degrees against each other), and planes that are parallel say "
      "nothing new about a lens, wherever they stand: focal length and distance could be "
      "anything. Take poses with the board tilted by 20 to 40 degrees to the left, to the "
      "right, up and down",
      views.size(),
      distinct.size(),
      distinct.size() == 1 ? "" : "s",
      to_degrees(Radians{most_turn}).value);
}

Status check_focal(const char* whose,
                   double focal,
                   double deviation,
                   const GeometryOptions& options,
                   std::vector<std::string>& warnings) {
  const double part = deviation / focal;
  if (!(part <= options.most_focal_deviation)) {
    return fail(
        Errc::kBadFormat,
        "calibrating the geometry: the {}'s focal length of {:.0f} pixels is known to {:.0f} "
        "({:.1f} %) only, more than the {:.1f} % that are allowed; tilt the board more and in "
        "more directions, bring it to the border of the picture, and add poses",
        whose,
        focal,
        deviation,
        100 * part,
        100 * options.most_focal_deviation);
  }
  if (part > kDoubtfulFocal) {
    warnings.push_back(
        fmt::format("the {}'s focal length is known to {:.1f} % only; add poses with the board "
                    "tilted differently",
                    whose,
                    100 * part));
  }
  return {};
}

/// Relative, as StartCheck::disagreement says.
double disagreement(const Rig& a, const Rig& b) {
  const auto lens = [](const Lens& p, const Lens& q) {
    return std::max({std::abs(p.fx - q.fx),
                     std::abs(p.fy - q.fy),
                     std::abs(p.cx - q.cx),
                     std::abs(p.cy - q.cy)}) /
           std::abs(q.fx);
  };
  const Eigen::Vector3d shift =
      a.projector_from_camera.translation - b.projector_from_camera.translation;
  return std::max({lens(a.camera, b.camera),
                   lens(a.projector, b.projector),
                   shift.cwiseAbs().maxCoeff() / b.projector_from_camera.translation.norm()});
}

/// Fits from every start and keeps the best.
Result<Estimate> fit_from_everywhere(std::span<const View> views,
                                     const GeometryOptions& options,
                                     const std::vector<Start>& starts,
                                     GeometryCalibration& result,
                                     Progress& progress) {
  struct End {
    Estimate estimate;
    double rms;
  };
  std::vector<End> ends;
  for (const Start& start : starts) {
    End end{start.estimate, 0};
    const FitOutcome outcome = fit_jointly(views, joint_model(options), end.estimate);
    progress.advance();
    if (!outcome.solved) continue;
    end.rms = errors_of(views, end.estimate).stereo_rms();
    if (!std::isfinite(end.rms)) continue;
    result.starts.push_back({start.name, end.rms, outcome.iterations, 0});
    ends.push_back(std::move(end));
  }
  if (ends.empty()) {
    return fail(Errc::kBadFormat,
                "calibrating the geometry: no projector and camera explain the points; check that "
                "the pictures belong to the poses, and the projector's size and the step");
  }
  const auto best = std::ranges::min_element(ends, {}, &End::rms);
  for (std::size_t i = 0; i < ends.size(); ++i) {
    StartCheck& check = result.starts[i];
    check.disagreement = disagreement(ends[i].estimate.rig, best->estimate.rig);
    result.start_disagreement = std::max(result.start_disagreement, check.disagreement);
    if (check.disagreement > kDoubtfulStart) {
      result.warnings.push_back(
          fmt::format("the fit that began with {} ended elsewhere, at {:.3f} pixels in place of "
                      "{:.3f}: the poses hold the answer badly; add more",
                      check.name,
                      check.stereo_rms_px,
                      best->rms));
    }
  }
  return std::move(best->estimate);
}

/// Box of the projector pixels of all views.
struct PixelBox {
  Eigen::Vector2d least = Eigen::Vector2d::Constant(1e9);
  Eigen::Vector2d most = Eigen::Vector2d::Constant(-1e9);
};

/// @param depth  of the views before the projector.
double most_off(const Rig& full, const Rig& pinhole, const PixelBox& box, double depth) {
  constexpr int kSteps = 16;
  double most = 0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d pixel =
          box.least + (box.most - box.least).cwiseProduct(Eigen::Vector2d(i, j) / kSteps);
      const Lens& lens = pinhole.projector;
      const Eigen::Vector3d x_in_pinhole =
          depth *
          Eigen::Vector3d((pixel.x() - lens.cx) / lens.fx, (pixel.y() - lens.cy) / lens.fy, 1);
      const Eigen::Vector3d x_in_full =
          full.projector_from_camera * (pinhole.projector_from_camera.inverse() * x_in_pinhole);
      const double off = (full.projector.project(x_in_full) - pixel).norm();
      if (std::isfinite(off)) most = std::max(most, off);
    }
  }
  return most;
}

PinholeProjector fit_pinhole(std::span<const View> views,
                             const GeometryOptions& options,
                             const Estimate& full) {
  Estimate plain = full;
  Lens& lens = plain.rig.projector;
  lens.k1 = lens.k2 = lens.p1 = lens.p2 = lens.k3 = 0;
  FitModel model = joint_model(options);
  model.projector_model = LensModel::kPinhole;
  model.moving = Moving::kProjector;
  fit_jointly(views, model, plain);
  const Errors errors = errors_of(views, plain);

  PixelBox box;
  double depth = 0;
  int count = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t i = 0; i < views[v].x_in_object.size(); ++i) {
      const Eigen::Vector2d& pixel = views[v].projector[i];
      if (!pixel.allFinite()) continue;
      box.least = box.least.cwiseMin(pixel);
      box.most = box.most.cwiseMax(pixel);
      depth += (plain.rig.projector_from_camera *
                (plain.camera_from_object[v] * views[v].x_in_object[i]))
                   .z();
      ++count;
    }
  }
  return {plain.rig.projector,
          plain.rig.projector_from_camera,
          errors.projector_rms(),
          most_off(full.rig, plain.rig, box, depth / count)};
}

/// The pose of a view by the camera's points alone, refined; absent without a solution.
std::optional<RigidTransform> camera_pose(const View& view,
                                          const Rig& rig,
                                          const GeometryOptions& options) {
  const auto start = pose_of(view.x_in_object, view.camera, rig.camera);
  if (!start) return std::nullopt;
  Estimate estimate{rig, {*start}};
  FitModel model = joint_model(options);
  model.use_projector = false;
  model.moving = Moving::kViews;
  fit_jointly({&view, 1}, model, estimate);
  return estimate.camera_from_object[0];
}

void leave_out_each(std::span<const View> views,
                    const GeometryOptions& options,
                    const Estimate& full,
                    GeometryCalibration& result,
                    Progress& progress) {
  Errors held_out;
  for (std::size_t out = 0; out < views.size(); ++out) {
    std::vector<View> rest(views.begin(), views.end());
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(out));
    Estimate estimate = full;
    estimate.camera_from_object.erase(estimate.camera_from_object.begin() +
                                      static_cast<std::ptrdiff_t>(out));
    fit_jointly(rest, joint_model(options), estimate);
    progress.advance();
    LeftOut left;
    left.name = views[out].name;
    left.camera_focal = estimate.rig.camera.fx;
    left.projector_focal = estimate.rig.projector.fx;
    left.projector_from_camera = estimate.rig.projector_from_camera;
    left.stereo_rms_px = errors_of(rest, estimate).stereo_rms();
    if (const auto pose = camera_pose(views[out], estimate.rig, options)) {
      const Errors predicted = errors_of(views[out], estimate.rig, *pose, 1);
      left.held_out_camera_rms_px = predicted.camera_rms();
      left.held_out_projector_rms_px = predicted.projector_rms();
      held_out.add(predicted);
    } else {
      result.warnings.push_back(fmt::format(
          "pose {}: what the others say of the camera does not explain its points at all",
          left.name));
    }
    result.left_out.push_back(std::move(left));
  }
  result.held_out_camera_rms_px = held_out.camera_rms();
  result.held_out_projector_rms_px = held_out.projector_rms();
}

/// The camera by itself: what the joint fit starts from, and a figure that others report.
Result<Estimate> fit_camera(std::span<const View> views, const GeometryOptions& options) {
  std::optional<Estimate> estimate = initial_camera(views, options);
  if (!estimate) {
    return fail(
        Errc::kBadFormat,
        "calibrating the geometry: no focal length explains the camera's points; check that "
        "columns and rows of the board are not exchanged");
  }
  VENEER_TRY(check_orientations(views, *estimate, options));
  FitModel model = joint_model(options);
  model.use_projector = false;
  if (!fit_jointly(views, model, *estimate).solved) {
    return fail(Errc::kBadFormat,
                "calibrating the geometry: the camera's points do not agree with any lens");
  }
  return *std::move(estimate);
}

void fill_views(std::span<const View> views,
                const GeometryOptions& options,
                const Estimate& estimate,
                GeometryCalibration& result) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Errors errors = errors_of(
        views[v], estimate.rig, estimate.camera_from_object[v], kOutlierLosses * options.loss_px);
    result.views.push_back({views[v].name,
                            errors.camera_points,
                            errors.projector_points,
                            errors.camera_rms(),
                            errors.projector_rms(),
                            errors.outliers});
    if (errors.outliers > 0) {
      result.warnings.push_back(
          fmt::format("pose {}: {} of {} points are more than {:.0f} pixels off",
                      views[v].name,
                      errors.outliers,
                      errors.camera_points + errors.projector_points,
                      kOutlierLosses * options.loss_px));
    }
    result.camera_from_object.push_back(estimate.camera_from_object[v]);
    result.projector_from_object.push_back(estimate.rig.projector_from_camera *
                                           estimate.camera_from_object[v]);
  }
}

}  // namespace

Status GeometryOptions::check() const {
  if (camera_width < 1 || camera_height < 1 || projector_width < 1 || projector_height < 1) {
    return fail(Errc::kInvalidOption,
                "calibrating the geometry: a camera of {} x {} and a projector of {} x {} pixels; "
                "every side has to be above 0",
                camera_width,
                camera_height,
                projector_width,
                projector_height);
  }
  if (!(loss_px > 0) || !std::isfinite(loss_px) || !(least_turn_deg > 0 && least_turn_deg < 90) ||
      !(most_focal_deviation > 0) || !(most_rms_px > 0)) {
    return fail(
        Errc::kInvalidOption,
        "calibrating the geometry: loss_px is {}, most_focal_deviation {} and most_rms_px {} "
        "(all above 0), least_turn_deg {} (above 0, below 90)",
        loss_px,
        most_focal_deviation,
        most_rms_px,
        least_turn_deg);
  }
  return {};
}

Result<GeometryCalibration> calibrate_geometry(std::span<const View> views,
                                               const GeometryOptions& options,
                                               Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_TRY(check_views(views));
  VENEER_ASSIGN(const Estimate camera_alone, fit_camera(views, options));
  GeometryCalibration result;
  result.camera_rms_px = errors_of(views, camera_alone).camera_rms();

  const std::vector<Start> starts = starts_from(views, options, camera_alone);
  const bool leaves_out = options.leave_one_out && views.size() >= kLeastForLeaveOneOut;
  progress.start("fitting projector and camera",
                 static_cast<std::int64_t>(starts.size() + (leaves_out ? views.size() : 0) + 1));
  VENEER_ASSIGN(const Estimate best, fit_from_everywhere(views, options, starts, result, progress));
  const Errors errors = errors_of(views, best);
  result.camera = best.rig.camera;
  result.projector = best.rig.projector;
  result.projector_from_camera = best.rig.projector_from_camera;
  result.projector_rms_px = errors.projector_rms();
  result.stereo_rms_px = errors.stereo_rms();
  if (!(result.stereo_rms_px <= options.most_rms_px)) {
    return fail(
        Errc::kBadFormat,
        "calibrating the geometry: the best fit is still off by {:.1f} pixels (camera {:.1f} "
        "alone, projector {:.1f}), so the points contradict each other; check the "
        "projector's size and the step of the Gray code, that nothing moved within a pose, "
        "and the decoded parts of each pose",
        result.stereo_rms_px,
        result.camera_rms_px,
        result.projector_rms_px);
  }
  const std::optional<Deviations> deviations = deviations_at(views, joint_model(options), best);
  if (!deviations) {
    return fail(Errc::kBadFormat,
                "calibrating the geometry: the poses leave a direction open in which lenses and "
                "poses can change together; tilt the board in more directions");
  }
  result.camera_deviations = deviations->camera;
  result.projector_deviations = deviations->projector;
  result.translation_deviations = deviations->translation;
  result.rotation_deviations_rad = deviations->rotation_rad;
  const auto check_lens =
      [&](const char* whose, const Lens& lens, const LensDeviations& d) -> Status {
    VENEER_TRY(check_focal(whose, lens.fx, d.fx, options, result.warnings));
    return check_focal(whose, lens.fy, d.fy, options, result.warnings);
  };
  VENEER_TRY(check_lens("camera", result.camera, deviations->camera));
  VENEER_TRY(check_lens("projector", result.projector, deviations->projector));

  fill_views(views, options, best, result);
  result.pinhole = fit_pinhole(views, options, best);
  progress.advance();
  if (leaves_out) {
    leave_out_each(views, options, best, result, progress);
  } else if (options.leave_one_out) {
    result.warnings.push_back(fmt::format(
        "{} poses are too few to leave one out, so no error is held out; take at least {}",
        views.size(),
        kLeastForLeaveOneOut));
  }
  progress.finish(fmt::format("{:.3f} pixels", result.stereo_rms_px));
  return result;
}

Result<BoardCalibration> calibrate_geometry_from_pictures(std::span<const PoseCapture> poses,
                                                          const PatternPlan& plan,
                                                          const Board& board,
                                                          const BoardOptions& board_options,
                                                          const GeometryOptions& options,
                                                          Progress& progress) {
  VENEER_TRY(options.check());
  BoardCalibration result;
  std::vector<View> views;
  progress.start("decoding poses", static_cast<std::int64_t>(poses.size()));
  for (const PoseCapture& pose : poses) {
    if (!pose.pictures.empty() && (pose.pictures.front().width() != options.camera_width ||
                                   pose.pictures.front().height() != options.camera_height)) {
      return fail(
          Errc::kInvalidOption,
          "pose {}: its pictures are {} x {} pixels where the camera has {} x {}; all poses "
          "have to be of one camera",
          pose.name,
          pose.pictures.front().width(),
          pose.pictures.front().height(),
          options.camera_width,
          options.camera_height);
    }
    VENEER_ASSIGN(BoardView view,
                  observe_board(pose.name, pose.pictures, plan, board, board_options));
    views.push_back(view.view);
    result.observed.push_back(std::move(view));
    progress.advance();
  }
  progress.finish();
  VENEER_ASSIGN(result.geometry, calibrate_geometry(views, options, progress));
  for (const BoardView& view : result.observed)
    result.geometry.warnings.insert(
        result.geometry.warnings.end(), view.warnings.begin(), view.warnings.end());
  return result;
}

}  // namespace veneer::geometry
