// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "calibration/wizard/steps/internal_geometry.h"
#include "calibration/wizard/steps/internal_patches.h"
#include "capture/exposure.h"

namespace veneer::calibration {
namespace {

using geometry::BoardView;
using nlohmann::json;

/// Fewer make no rig, see register_boards() and calibrate_geometry().
constexpr std::size_t kLeastPoses = 4;
/// Corners of a board that must have been decoded for its pose to be kept.
constexpr double kLeastDecoded = 0.7;
constexpr int kTriesOfAPose = 3;

json to_json(const std::vector<Eigen::Vector2d>& points) {
  json list = json::array();
  for (const Eigen::Vector2d& p : points) list.push_back({p.x(), p.y()});
  return list;
}

/// NaN is null in JSON.
double number_from(const json& value) {
  return value.is_number() ? value.get<double>() : std::nan("");
}

std::vector<Eigen::Vector2d> points_from(const json& list) {
  std::vector<Eigen::Vector2d> points;
  for (const json& p : list) {
    points.emplace_back(number_from(p.at(0)), number_from(p.at(1)));
  }
  return points;
}

json to_json(const BoardView& view, const std::optional<tracking::SynchronisedPose>& sensor) {
  json value{{"camera", to_json(view.view.camera)},
             {"projector", to_json(view.view.projector)},
             {"corners_decoded", view.corners_decoded},
             {"corner_decoded_ratio", view.corner_decoded_ratio},
             {"homography_rms_px", view.homography_rms_px},
             {"decoded_ratio", view.decoded_ratio}};
  if (sensor) {
    const Eigen::Quaterniond& q = sensor->world_from_body.rotation;
    const Eigen::Vector3d& t = sensor->world_from_body.translation;
    value["sensor"] = {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                       {"position_m", {t.x(), t.y(), t.z()}},
                       {"position_deviation_m", sensor->position_deviation_m},
                       {"rotation_deviation_rad", sensor->rotation_deviation_rad},
                       {"samples", sensor->samples}};
  }
  return value;
}

/// One pose of the board, as it was seen or as the journal has it.
struct Pose {
  BoardView view;
  std::optional<tracking::SynchronisedPose> sensor;
};

/// Throws nlohmann's exceptions where the journal has something else there.
Pose pose_from(const json& value, const geometry::Board& board, const std::string& name) {
  Pose pose;
  pose.view.view = {
      name, board.corners(), points_from(value.at("camera")), points_from(value.at("projector"))};
  pose.view.corners = static_cast<int>(pose.view.view.x_in_object.size());
  value.at("corners_decoded").get_to(pose.view.corners_decoded);
  pose.view.corner_decoded_ratio = number_from(value.at("corner_decoded_ratio"));
  pose.view.homography_rms_px = number_from(value.at("homography_rms_px"));
  pose.view.decoded_ratio = number_from(value.at("decoded_ratio"));
  if (value.contains("sensor")) {
    const json& sensor = value["sensor"];
    const auto q = sensor.at("rotation_wxyz").get<std::array<double, 4>>();
    const auto t = sensor.at("position_m").get<std::array<double, 3>>();
    pose.sensor =
        tracking::SynchronisedPose{{Eigen::Quaterniond(q[0], q[1], q[2], q[3]), {t[0], t[1], t[2]}},
                                   sensor.at("position_deviation_m").get<double>(),
                                   sensor.at("rotation_deviation_rad").get<double>(),
                                   sensor.at("samples").get<int>()};
  }
  return pose;
}

/// Exposes the camera for the board under white light: nothing saturated, most of the range used.
Result<double> expose(StepContext& context) {
  constexpr int kTries = 10;
  constexpr double kWellExposed = 0.5;  // of full scale, at 99 % of the pixels
  capture::Camera& camera = *context.devices.camera;
  VENEER_TRY(context.devices.display->show(grey(full_code(context.devices))));
  std::string last;
  for (int i = 0; i < kTries; ++i) {
    VENEER_ASSIGN(const capture::CameraFrame frame, camera.grab());
    const capture::ExposureCheck check = capture::check_exposure(frame);
    if (check.saturated_fraction < 1e-4 && check.p99 > kWellExposed) return frame.exposure_s;
    last = fmt::format(
        "at {:.3g} ms {:.1f} % of the pixels are saturated and 99 % are under {:.0f} "
        "% of the range",
        1e3 * frame.exposure_s,
        100 * check.saturated_fraction,
        100 * check.p99);
    double exposure = capture::better_exposure(frame);
    // A projector that shows its colours one after the other needs whole frames.
    if (exposure > context.options.frame_s)
      exposure = context.options.frame_s * std::floor(exposure / context.options.frame_s);
    if (const Status set = camera.set_exposure(exposure); !set) {
      // Darker than the camera can make up for is better than nothing.
      if (check.saturated_fraction < 1e-4 && check.p99 > 0.1) return frame.exposure_s;
      return fail(Errc::kInvalidOption,
                  "exposing the camera: {}; {}; change the aperture or add a filter",
                  last,
                  set.error().what);
    }
  }
  return fail(Errc::kInvalidOption,
              "exposing the camera: {}; switch its automatic gain and exposure off, and change the "
              "aperture if that does not help",
              last);
}

Result<Pose> look_at_board(StepContext& context,
                           const geometry::PatternPlan& plan,
                           const std::string& name) {
  Devices& devices = context.devices;
  VENEER_ASSIGN(const double exposure, expose(context));
  (void)exposure;
  std::vector<geometry::GreyPicture> pictures;
  std::uint16_t full_scale = 0;
  context.progress.start(name, plan.pictures());
  for (int i = 0; i < plan.pictures(); ++i) {
    const Image<Rgb16> picture = geometry::draw_pattern_codes(plan, i, devices.bits);
    VENEER_TRY(devices.display->show_picture(picture.view()));
    VENEER_ASSIGN(const capture::CameraFrame frame, devices.camera->grab());
    full_scale = frame.full_scale;
    pictures.push_back(geometry::grey_of(frame.counts.view()));
    context.progress.advance();
  }
  geometry::BoardOptions options;
  options.decoding.full_scale = full_scale;
  VENEER_ASSIGN(BoardView view,
                geometry::observe_board(name, pictures, plan, context.options.board, options));
  const double decoded = static_cast<double>(view.corners_decoded) / std::max(view.corners, 1);
  context.progress.finish(fmt::format("{} of {} corners, {:.1f} % of the lit pixels decoded",
                                      view.corners_decoded,
                                      view.corners,
                                      100 * view.decoded_ratio));
  if (decoded < kLeastDecoded)
    return fail(
        Errc::kBadFormat,
        "{}: the projector's pixel is known for {} of {} corners only; bring the board wholly "
        "into the picture, and let it face the projector more",
        name,
        view.corners_decoded,
        view.corners);
  Pose pose{std::move(view), std::nullopt};
  if (devices.board_sensor != nullptr) {
    VENEER_ASSIGN(pose.sensor, devices.board_sensor->measure());
  }
  return pose;
}

/// All poses, from the journal or seen now.
Result<Answer> collect(StepContext& context,
                       const geometry::PatternPlan& plan,
                       std::vector<Pose>& poses) {
  const WizardOptions& options = context.options;
  for (int i = 0; i < options.board_poses; ++i) {
    const std::string key = fmt::format("pose {}", i + 1);
    if (const json* known = context.journal.find("geometry", key); known != nullptr) {
      try {
        if (!known->is_null()) poses.push_back(pose_from(*known, options.board, key));
        continue;
      } catch (const json::exception&) {
        // Seen anew below.
      }
    }
    for (int attempt = 1;; ++attempt) {
      VENEER_ASSIGN(
          const Answer answer,
          context.please(
              Task::kPlaceBoard,
              i,
              fmt::format("Place the board in the picture, pose {} of {}: tilt it another "
                          "way each time, by 20 to 40 degrees, nearer and farther.",
                          i + 1,
                          options.board_poses)));
      if (answer == Answer::kSkip) {
        VENEER_TRY(context.journal.add("geometry", key, nullptr));
        break;
      }
      if (answer != Answer::kDone) return answer;
      Result<Pose> pose = look_at_board(context, plan, key);
      if (pose) {
        VENEER_TRY(context.journal.add("geometry", key, to_json(pose->view, pose->sensor)));
        poses.push_back(*std::move(pose));
        break;
      }
      const Errc code = pose.error().code;
      const bool placed_badly = code == Errc::kNotFound || code == Errc::kBadFormat;
      if (!placed_badly) return tl::unexpected(pose.error());
      if (attempt == kTriesOfAPose) {
        context.find({Finding::Severity::kNote, pose.error().what, "this pose was left out"});
        VENEER_TRY(context.journal.add("geometry", key, nullptr));
        break;
      }
      context.devices.hands->say("  " + pose.error().what + "; try this pose once more");
    }
  }
  return Answer::kDone;
}

geometry::GeometryOptions geometry_options(const Devices& devices) {
  geometry::GeometryOptions options;
  options.camera_width = devices.camera->width();
  options.camera_height = devices.camera->height();
  options.projector_width = devices.width;
  options.projector_height = devices.height;
  return options;
}

void set_reprojections(WizardResults& results) {
  const geometry::GeometryCalibration& fit = *results.geometry;
  results.reprojections.clear();
  for (std::size_t v = 0; v < results.views.size(); ++v) {
    const geometry::View& view = results.views[v].view;
    for (std::size_t i = 0; i < view.projector.size(); ++i) {
      const Eigen::Vector2d expected =
          fit.projector.project(fit.projector_from_object[v] * view.x_in_object[i]);
      if (!view.projector[i].allFinite() || !expected.allFinite()) continue;
      results.reprojections.push_back(
          {static_cast<int>(v), view.projector[i], view.projector[i] - expected});
    }
  }
}

/// Where the projector stands in the world that the tracker knows.
Status place_projector(StepContext& context) {
  WizardResults& results = context.results;
  const geometry::GeometryCalibration& fit = *results.geometry;
  const geometry::PinholeProjector& pinhole = fit.pinhole;
  std::vector<RigidTransform> projector_from_board;
  for (const RigidTransform& camera_from_board : fit.camera_from_object)
    projector_from_board.push_back(pinhole.projector_from_camera * camera_from_board);

  ProjectorGeometry projector{context.devices.width,
                              context.devices.height,
                              pinhole.lens.fx,
                              pinhole.lens.fy,
                              pinhole.lens.cx,
                              pinhole.lens.cy,
                              {}};
  if (results.sensors.size() == projector_from_board.size()) {
    std::vector<geometry::BoardPose> poses;
    for (std::size_t i = 0; i < projector_from_board.size(); ++i)
      poses.push_back({results.views[i].view.name, projector_from_board[i], results.sensors[i]});
    VENEER_ASSIGN(results.registration, geometry::register_boards(poses));
    for (const std::string& warning : results.registration->warnings)
      context.find({Finding::Severity::kWarning, warning, ""});
    results.projector = projector;
    return tie_to_tracker(context);
  }
  projector.world_from_projector = projector_from_board.front().inverse();
  context.find({Finding::Severity::kNote,
                "nothing tracks the board, so the world is the frame of its first pose",
                "fix a sensor to the board and name a tracker, so that the projector's place is "
                "known to it"});
  results.projector = projector;
  return {};
}

std::string summary_of(const WizardResults& results) {
  const geometry::GeometryCalibration& fit = *results.geometry;
  std::string text = fmt::format(
      "{} poses: projector {:.3f} px, camera {:.3f} px rms; poses that the fit did not "
      "see {:.3f} px; focal length {:.1f} +- {:.1f} px",
      results.views.size(),
      fit.projector_rms_px,
      fit.camera_rms_px,
      fit.held_out_projector_rms_px,
      fit.projector.fx,
      fit.projector_deviations.fx);
  if (results.tied)
    text += fmt::format("; by the tracker a pose that the fit did not see is off by {:.2f} px",
                        results.tied->held_out_px);
  return text;
}

}  // namespace

Status tie_to_tracker(StepContext& context) {
  WizardResults& results = context.results;
  const geometry::PinholeProjector& pinhole = results.geometry->pinhole;
  std::vector<geometry::View> views;
  for (const BoardView& view : results.views) views.push_back(view.view);
  geometry::TiedOptions options;
  // What one corner is off by; a fit of few corners may look better than it is.
  options.pixel_deviation_px = std::max(0.05, pinhole.projector_rms_px);
  VENEER_ASSIGN(results.tied,
                geometry::tie_registration(views,
                                           results.sensors,
                                           pinhole.lens,
                                           *results.registration,
                                           results.cross_hairs,
                                           options));
  results.projector->world_from_projector = results.tied->world_from_projector;
  return {};
}

Result<Answer> find_geometry(StepContext& context) {
  WizardResults& results = context.results;
  results.geometry.reset();
  results.projector.reset();
  if (context.devices.camera == nullptr) {
    if (!context.options.known_geometry)
      return fail(Errc::kUnavailable,
                  "there is no camera; name one, or take the geometry of an earlier profile or of "
                  "\"veneer calibrate geometry\" over with --geometry");
    results.projector = context.options.known_geometry;
    context.report.summary = "taken over, as there is no camera";
    return Answer::kDone;
  }
  VENEER_ASSIGN(const geometry::PatternPlan plan,
                geometry::gray_code_plan(context.devices.width, context.devices.height, 1));
  std::vector<Pose> poses;
  VENEER_ASSIGN(const Answer collected, collect(context, plan, poses));
  if (collected != Answer::kDone) return collected;
  VENEER_ASSIGN(const Answer removed,
                context.please(Task::kRemoveBoard, 0, "Take the chequered board away."));
  if (removed != Answer::kDone) return removed;
  if (poses.size() < kLeastPoses)
    return fail(Errc::kBadFormat,
                "only {} poses of the board could be used and {} are needed; do this step again",
                poses.size(),
                kLeastPoses);
  results.views.clear();
  results.sensors.clear();
  results.cross_hairs.clear();
  results.registration.reset();
  results.tied.reset();
  std::vector<geometry::View> views;
  for (Pose& pose : poses) {
    views.push_back(pose.view.view);
    if (pose.sensor) results.sensors.push_back(*pose.sensor);
    results.views.push_back(std::move(pose.view));
  }
  VENEER_ASSIGN(
      results.geometry,
      geometry::calibrate_geometry(views, geometry_options(context.devices), context.progress));
  for (const std::string& warning : results.geometry->warnings)
    context.find({Finding::Severity::kWarning, warning, ""});
  set_reprojections(results);
  VENEER_TRY(place_projector(context));
  context.report.summary = summary_of(results);
  return Answer::kDone;
}

}  // namespace veneer::calibration
