// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/calibrate_geometry.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <optional>
#include <sstream>

#include "base/exit_code.h"
#include "base/image_files.h"
#include "calibration/geometry/bundle_adjustment.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using namespace geometry;
using nlohmann::ordered_json;

/// Fits from different starts are one answer if they agree to this, relative.
constexpr double kMostDisagreement = 1e-6;
constexpr const char* kPublishedName = "calibration_result.xml";

struct Options {
  std::vector<fs::path> poses;
  std::string board;
  double square = 0;
  std::string projector;
  int step = 1;
  int period = 0;
  int shifts = 4;
  std::string lens = "radial";
  std::string loss = "huber";
  fs::path published;
};

/// "9x7" as two numbers above 0.
Result<std::pair<int, int>> parse_pair(const char* option, const std::string& text) {
  std::istringstream stream(text);
  int first = 0;
  int second = 0;
  char cross = 0;
  if (!(stream >> first >> cross >> second) || cross != 'x' || !stream.eof() || first < 1 ||
      second < 1) {
    return fail(Errc::kInvalidOption,
                "{} {}: two whole numbers are wanted, such as 9x7 or 2048x1536",
                option,
                text);
  }
  return std::pair{first, second};
}

/// The pictures of a folder, sorted by name. Those of 8 bits keep their counts.
Result<std::vector<GreyPicture>> read_pictures(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  }
  if (error) {
    return fail(Errc::kNotFound,
                "reading the pose {}: {}; name a folder of pictures",
                folder.string(),
                error.message());
  }
  if (files.empty()) {
    return fail(Errc::kNotFound,
                "reading the pose {}: there is no picture NAME.png in it",
                folder.string());
  }
  std::ranges::sort(files);
  std::vector<GreyPicture> pictures;
  // read_png16 spreads 8 bits over 16 by this factor; noise is to be in counts.
  constexpr int kSpread = 257;
  bool eight_bits = true;
  for (const fs::path& file : files) {
    VENEER_ASSIGN(const Image<Rgb16> picture, read_png16(file));
    pictures.push_back(grey_of(picture.view()));
    eight_bits =
        eight_bits && std::ranges::all_of(pictures.back().pixels(),
                                          [](std::uint16_t count) { return count % kSpread == 0; });
  }
  if (eight_bits) {
    for (GreyPicture& picture : pictures)
      for (std::uint16_t& count : picture.pixels()) count /= kSpread;
  }
  return pictures;
}

/// The last part of the path, also of "folder/".
std::string name_of(const fs::path& folder) {
  return folder.has_filename() ? folder.filename().string()
                               : folder.parent_path().filename().string();
}

struct Measured {
  std::vector<BoardView> poses;
  GeometryCalibration geometry;
  std::optional<RigEvaluation> published;
  fs::path published_path;
};

Result<Measured> measure(const Options& options, const Board& board, Progress& progress) {
  VENEER_TRY(board.check());
  VENEER_ASSIGN(const auto raster, parse_pair("--projector", options.projector));
  const auto [width, height] = raster;
  VENEER_ASSIGN(const PatternPlan plan,
                options.period > 0 ? phase_shift_plan(width, height, options.period, options.shifts)
                                   : gray_code_plan(width, height, options.step));
  GeometryOptions fit;
  fit.projector_width = width;
  fit.projector_height = height;
  const LensModel model = options.lens == "full"      ? LensModel::kFull
                          : options.lens == "pinhole" ? LensModel::kPinhole
                                                      : LensModel::kRadial;
  fit.camera_model = fit.projector_model = model;
  fit.loss = options.loss == "none"     ? Loss::kNone
             : options.loss == "cauchy" ? Loss::kCauchy
                                        : Loss::kHuber;
  Measured measured;
  std::vector<View> views;
  progress.start("decoding poses", static_cast<std::int64_t>(options.poses.size()));
  for (const fs::path& folder : options.poses) {
    // One pose at a time: a sequence is a hundred megabytes.
    VENEER_ASSIGN(const std::vector<GreyPicture> pictures, read_pictures(folder));
    const GreyPicture& first = pictures.front();
    if (views.empty()) {
      fit.camera_width = first.width();
      fit.camera_height = first.height();
    } else if (first.width() != fit.camera_width || first.height() != fit.camera_height) {
      return fail(
          Errc::kBadFormat,
          "pose {}: its pictures are {} x {} pixels and those of {} {} x {}; all poses have "
          "to be of one camera",
          name_of(folder),
          first.width(),
          first.height(),
          views.front().name,
          fit.camera_width,
          fit.camera_height);
    }
    VENEER_ASSIGN(BoardView view, observe_board(name_of(folder), pictures, plan, board));
    views.push_back(view.view);
    measured.poses.push_back(std::move(view));
    progress.advance();
  }
  progress.finish();
  VENEER_ASSIGN(measured.geometry, geometry::calibrate_geometry(views, fit, progress));
  for (const BoardView& pose : measured.poses)
    measured.geometry.warnings.insert(
        measured.geometry.warnings.end(), pose.warnings.begin(), pose.warnings.end());

  measured.published_path = options.published;
  const fs::path beside =
      fs::absolute(options.poses.front() / "..").lexically_normal() / kPublishedName;
  if (options.published.empty() && fs::exists(beside)) measured.published_path = beside;
  if (!measured.published_path.empty()) {
    VENEER_ASSIGN(const Rig rig, read_opencv_rig(measured.published_path));
    VENEER_ASSIGN(measured.published, evaluate_rig(rig, views, fit));
  }
  return measured;
}

ordered_json json_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

ordered_json json_of(const Lens& lens) {
  return {{"fx", lens.fx},
          {"fy", lens.fy},
          {"cx", lens.cx},
          {"cy", lens.cy},
          {"k1", lens.k1},
          {"k2", lens.k2},
          {"p1", lens.p1},
          {"p2", lens.p2},
          {"k3", lens.k3}};
}

ordered_json json_of(const LensDeviations& d) {
  return json_of(Lens{d.fx, d.fy, d.cx, d.cy, d.k1, d.k2, d.p1, d.p2, d.k3});
}

ordered_json json_of(const Eigen::Quaterniond& turn) {
  ordered_json rows = ordered_json::array();
  const Eigen::Matrix3d matrix = turn.toRotationMatrix();
  for (int row = 0; row < 3; ++row) rows.push_back(json_of(Eigen::Vector3d(matrix.row(row))));
  return rows;
}

/// Least and largest of what came out without each pose.
template <class Value>
std::pair<double, double> spread_of(const std::vector<LeftOut>& left_out, Value&& value) {
  std::pair<double, double> spread{value(left_out.front()), value(left_out.front())};
  for (const LeftOut& left : left_out) {
    spread.first = std::min(spread.first, value(left));
    spread.second = std::max(spread.second, value(left));
  }
  return spread;
}

std::pair<double, double> focal_spread(const std::vector<LeftOut>& left_out) {
  return spread_of(left_out, [](const LeftOut& left) { return left.projector_focal; });
}

std::pair<double, double> translation_spread(const std::vector<LeftOut>& left_out, int axis) {
  return spread_of(left_out, [axis](const LeftOut& left) {
    return left.projector_from_camera.translation[axis];
  });
}

ordered_json json_of(const Measured& measured) {
  const GeometryCalibration& g = measured.geometry;
  int corners = 0;
  int decoded = 0;
  double least_ratio = 1;
  ordered_json poses = ordered_json::array();
  for (std::size_t i = 0; i < measured.poses.size(); ++i) {
    const BoardView& pose = measured.poses[i];
    corners += pose.corners;
    decoded += pose.corners_decoded;
    least_ratio = std::min(least_ratio, pose.corner_decoded_ratio);
    poses.push_back({{"pose", pose.view.name},
                     {"corners", pose.corners},
                     {"corners_decoded", pose.corners_decoded},
                     {"lit_corner_pixels_decoded", pose.corner_decoded_ratio},
                     {"lit_pixels_decoded", pose.decoded_ratio},
                     {"homography_rms", pose.homography_rms_px},
                     {"camera_rms", g.views[i].camera_rms_px},
                     {"projector_rms", g.views[i].projector_rms_px},
                     {"outliers", g.views[i].outliers},
                     {"pattern_ratio", pose.pattern_ratio}});
  }
  ordered_json json{{"camera_rms", g.camera_rms_px},
                    {"projector_rms", g.projector_rms_px},
                    {"stereo_rms", g.stereo_rms_px},
                    {"projector_focal", g.projector.fx},
                    {"camera_focal", g.camera.fx},
                    {"translation", json_of(g.projector_from_camera.translation)},
                    {"translation_deviation", json_of(g.translation_deviations)},
                    {"rotation", json_of(g.projector_from_camera.rotation)},
                    {"rotation_deviation_rad", json_of(g.rotation_deviations_rad)},
                    {"corners", corners},
                    {"corners_decoded", decoded},
                    {"lit_corner_pixels_decoded", least_ratio},
                    {"camera", json_of(g.camera)},
                    {"camera_deviation", json_of(g.camera_deviations)},
                    {"projector", json_of(g.projector)},
                    {"projector_deviation", json_of(g.projector_deviations)},
                    {"poses", poses},
                    {"held_out_camera_rms", g.held_out_camera_rms_px},
                    {"held_out_projector_rms", g.held_out_projector_rms_px},
                    {"leave_one_out", ordered_json::array()}};
  for (const LeftOut& left : g.left_out) {
    json["leave_one_out"].push_back(
        {{"pose", left.name},
         {"camera_focal", left.camera_focal},
         {"projector_focal", left.projector_focal},
         {"translation", json_of(left.projector_from_camera.translation)},
         {"stereo_rms", left.stereo_rms_px},
         {"held_out_camera_rms", left.held_out_camera_rms_px},
         {"held_out_projector_rms", left.held_out_projector_rms_px}});
  }
  if (!g.left_out.empty()) {
    ordered_json& spread = json["leave_one_out_spread"];
    spread["projector_focal"] = focal_spread(g.left_out);
    for (int axis = 0; axis < 3; ++axis)
      spread["translation"].push_back(translation_spread(g.left_out, axis));
  }
  json["start_disagreement"] = g.start_disagreement;
  for (const StartCheck& start : g.starts) {
    json["starts"].push_back({{"start", start.name},
                              {"stereo_rms", start.stereo_rms_px},
                              {"iterations", start.iterations},
                              {"disagreement", start.disagreement}});
  }
  json["pinhole"] = {{"projector", json_of(g.pinhole.lens)},
                     {"translation", json_of(g.pinhole.projector_from_camera.translation)},
                     {"rotation", json_of(g.pinhole.projector_from_camera.rotation)},
                     {"projector_rms", g.pinhole.projector_rms_px},
                     {"most_off", g.pinhole.most_off_px}};
  if (measured.published) {
    json["published"] = {{"file", measured.published_path.string()},
                         {"stereo_rms", measured.published->stereo_rms_px},
                         {"optimum_rms", measured.published->optimum_rms_px},
                         {"projector_focal_change", measured.published->focal_change},
                         {"translation_change", measured.published->translation_change},
                         {"converged", measured.published->converged}};
  }
  json["warnings"] = g.warnings;
  return json;
}

std::string text_of(const Measured& measured) {
  const GeometryCalibration& g = measured.geometry;
  std::string text = fmt::format("{:<16} {:>9} {:>9} {:>8} {:>10} {:>9}",
                                 "pose",
                                 "corners",
                                 "decoded",
                                 "camera",
                                 "projector",
                                 "held out");
  for (std::size_t i = 0; i < measured.poses.size(); ++i) {
    const BoardView& pose = measured.poses[i];
    text += fmt::format(
        "\n{:<16} {:>9} {:>7.1f} % {:>8.3f} {:>10.3f} {:>9}",
        pose.view.name,
        fmt::format("{}/{}", pose.corners_decoded, pose.corners),
        100 * pose.corner_decoded_ratio,
        g.views[i].camera_rms_px,
        g.views[i].projector_rms_px,
        g.left_out.empty() ? "-" : fmt::format("{:.3f}", g.left_out[i].held_out_projector_rms_px));
  }
  const Eigen::Vector3d& t = g.projector_from_camera.translation;
  const Eigen::Vector3d& d = g.translation_deviations;
  text += fmt::format(
      "\n(root mean squares in pixels; held out: the projector's corners as the other poses "
      "predict "
      "them)\ncamera alone {:.3f} pixels; both together {:.3f}\n"
      "projector: focal length {:.1f} +- {:.1f} pixels, principal point ({:.1f}, {:.1f})\n"
      "camera: focal length {:.1f} +- {:.1f} pixels, principal point ({:.1f}, {:.1f})\n"
      "projector_from_camera: ({:.2f}, {:.2f}, {:.2f}) +- ({:.2f}, {:.2f}, {:.2f}), in the unit of "
      "the squares",
      g.camera_rms_px,
      g.stereo_rms_px,
      g.projector.fx,
      g.projector_deviations.fx,
      g.projector.cx,
      g.projector.cy,
      g.camera.fx,
      g.camera_deviations.fx,
      g.camera.cx,
      g.camera.cy,
      t.x(),
      t.y(),
      t.z(),
      d.x(),
      d.y(),
      d.z());
  if (!g.left_out.empty()) {
    const auto focal = focal_spread(g.left_out);
    text += fmt::format("\nwithout one pose at a time: focal length {:.1f} to {:.1f}, translation",
                        focal.first,
                        focal.second);
    for (int axis = 0; axis < 3; ++axis) {
      const auto along = translation_spread(g.left_out, axis);
      text += fmt::format("{} {:.1f} to {:.1f}", axis == 0 ? "" : ",", along.first, along.second);
    }
    text += fmt::format("; a pose that was not fitted is predicted to {:.3f} pixels",
                        g.held_out_projector_rms_px);
  }
  text += fmt::format(
      "\n{} fits from different starts agree to {:.0e}", g.starts.size(), g.start_disagreement);
  text += fmt::format(
      "\nas a plain pinhole, without distortion, the projector is off by {:.3f} pixels in place of "
      "{:.3f}, {:.1f} at most",
      g.pinhole.projector_rms_px,
      g.projector_rms_px,
      g.pinhole.most_off_px);
  if (measured.published) {
    const RigEvaluation& p = *measured.published;
    text += fmt::format(
        "\nthe published result in {} leaves {:.3f} pixels here, the optimum that a fit reaches "
        "from "
        "it {:.3f}: it had {}converged (its focal length was {:.1f} % off, its translation {:.1f} "
        "%)",
        measured.published_path.filename().string(),
        p.stereo_rms_px,
        p.optimum_rms_px,
        p.converged ? "" : "not ",
        100 * p.focal_change,
        100 * p.translation_change);
  }
  return text;
}

}  // namespace

Result<int> calibrate_geometry(CommandLine& line) {
  Options options;
  line.app().require_subcommand(1);
  CLI::App& app = *line.app()
                       .add_subcommand("geometry", "Lenses and pose of a projector and a camera")
                       ->fallthrough();
  app.add_option("--poses",
                 options.poses,
                 "A folder a pose of the board: the pictures of the sequence, NAME.png, by name in "
                 "the order in which they were shown, white and black last")
      ->required();
  app.add_option("--board", options.board, "Inner corners of the chessboard, COLUMNSxROWS")
      ->required();
  app.add_option("--square", options.square, "Side of its squares; lengths come out in this unit")
      ->required();
  app.add_option("--projector", options.projector, "The projector's pixels, WIDTHxHEIGHT")
      ->required();
  app.add_option("--graycode-step", options.step, "Pixels of a block of the Gray code")
      ->capture_default_str();
  app.add_option("--phase-period",
                 options.period,
                 "Sinusoids of so many pixels follow the Gray code, whose blocks are half of it");
  app.add_option("--phase-shifts", options.shifts, "Pictures of each sinusoid")
      ->capture_default_str();
  app.add_option("--lens",
                 options.lens,
                 "What is fitted: pinhole, radial (and k1, k2) or full (and k3, p1, p2)")
      ->capture_default_str()
      ->check(CLI::IsMember({"full", "pinhole", "radial"}));
  app.add_option("--loss", options.loss, "How points that are far off count")
      ->capture_default_str()
      ->check(CLI::IsMember({"cauchy", "huber", "none"}));
  app.add_option("--published",
                 options.published,
                 "A result to be judged on these poses, in OpenCV's storage; by default "
                 "calibration_result.xml beside the first pose, if there is one");
  line.parse();
  VENEER_ASSIGN(const auto corners, parse_pair("--board", options.board));
  const Board board{corners.first, corners.second, options.square};
  VENEER_ASSIGN(const Measured measured, measure(options, board, line.progress()));
  for (const std::string& warning : measured.geometry.warnings) line.note("warning: " + warning);
  line.print(json_of(measured), text_of(measured));
  return measured.geometry.start_disagreement <= kMostDisagreement ? kExitDone : kExitGateMissed;
}

}  // namespace veneer::cli
