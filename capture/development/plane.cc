// SPDX-License-Identifier: Apache-2.0
#include <opencv2/calib3d.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/statistics.h"
#include "capture/development/internal_lens.h"
#include "capture/development/internal_opencv.h"
#include "capture/development/rectification.h"

namespace veneer::capture {
namespace {

constexpr double kMillimetre = 1e-3;
constexpr double kMostResidualPx = 2;  // above it, board or lens are not those that are told
constexpr std::size_t kLeastCorners = 6;
/// A corner that is off by this many robust standard deviations, and by this many pixels at least,
/// is left out; but not more than this part of them.
constexpr double kOutlierSigmas = 4;
constexpr double kOutlierPx = 0.3;
constexpr double kMostOutliers = 0.2;
/// A focal length that is not known better than to this part is not known.
constexpr double kFocalSigma = 0.03;
constexpr double kFocalTrial = 0.05;      // a focal length that is wrong by this part is tried
constexpr double kLeastCornerRms = 0.02;  // pixels; no corner is found better
/// Fewer views tell a focal length; the rest would be bent to their noise.
constexpr std::size_t kViewsForAll = 3;

Status check_marks(const FoundMarks& marks) {
  if (marks.pixels.size() != marks.board_mm.size() || marks.pixels.size() < kLeastCorners) {
    return fail(Errc::kBadFormat,
                "locating the board: {} corners in the picture and {} on the board; {} pairs are "
                "needed",
                marks.pixels.size(),
                marks.board_mm.size(),
                kLeastCorners);
  }
  for (std::size_t i = 0; i < marks.pixels.size(); ++i)
    if (!marks.pixels[i].allFinite() || !marks.board_mm[i].allFinite())
      return fail(Errc::kBadFormat, "locating the board: corner {} is not a finite number", i);
  return {};
}

cv::Mat camera_matrix(const CameraLens& lens) {
  return (cv::Mat_<double>(3, 3) << lens.focal_px.x(),
          0,
          lens.principal_point.x() - kPixelCentre,
          0,
          lens.focal_px.y(),
          lens.principal_point.y() - kPixelCentre,
          0,
          0,
          1);
}

/// Points of the board's plane, in metres from its middle corner: IPPE wants them around zero.
struct Points {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> pixels;
};
Points points_of(const FoundMarks& marks, const std::vector<bool>& used) {
  Points points;
  double count = 0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    points.middle.head<2>() += marks.board_mm[i] * kMillimetre;
    ++count;
  }
  points.middle /= count;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (!used[i]) continue;
    const Eigen::Vector2d place = marks.board_mm[i] * kMillimetre - points.middle.head<2>();
    points.board.emplace_back(place.x(), place.y(), 0);
    points.pixels.emplace_back(marks.pixels[i].x() - kPixelCentre,
                               marks.pixels[i].y() - kPixelCentre);
  }
  return points;
}

std::vector<double> residuals(const FoundMarks& marks,
                              const CameraLens& lens,
                              const RigidTransform& camera_from_board) {
  std::vector<double> off;
  for (std::size_t i = 0; i < marks.pixels.size(); ++i) {
    const Eigen::Vector2d place = marks.board_mm[i] * kMillimetre;
    const auto pixel = project(lens, camera_from_board * Eigen::Vector3d(place.x(), place.y(), 0));
    off.push_back(pixel ? (*pixel - marks.pixels[i]).norm()
                        : std::numeric_limits<double>::infinity());
  }
  return off;
}

double root_mean_square(const std::vector<double>& values, const std::vector<bool>& used) {
  double sum = 0;
  double count = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!used[i]) continue;
    sum += values[i] * values[i];
    ++count;
  }
  return std::sqrt(sum / count);
}

/// Of the two poses between which a plane's picture hardly chooses, the one with less error.
RigidTransform pose_of(const FoundMarks& marks,
                       const CameraLens& lens,
                       const std::vector<bool>& used) {
  const Points points = points_of(marks, used);
  const cv::Mat matrix = camera_matrix(lens);
  const std::vector<double> bending{lens.k1, lens.k2, 0, 0};
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  cv::solvePnPGeneric(points.board,
                      points.pixels,
                      matrix,
                      bending,
                      rotations,
                      translations,
                      false,
                      cv::SOLVEPNP_IPPE);
  RigidTransform best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    cv::solvePnPRefineLM(points.board,
                         points.pixels,
                         matrix,
                         bending,
                         rotations[i],
                         translations[i],
                         {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-12});
    cv::Mat turned;
    cv::Rodrigues(rotations[i], turned);
    Eigen::Matrix3d rotation;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        rotation(row, column) = turned.at<double>(row, column);
    RigidTransform pose;
    pose.rotation = Eigen::Quaterniond(rotation).normalized();
    const cv::Mat& moved = translations[i];
    pose.translation =
        Eigen::Vector3d(moved.at<double>(0), moved.at<double>(1), moved.at<double>(2)) -
        pose.rotation * points.middle;
    const double rms = root_mean_square(residuals(marks, lens, pose), used);
    if (rms < least) {
      least = rms;
      best = pose;
    }
  }
  return best;
}

/// Leaves out the few corners that are off by far more than the rest.
std::vector<bool> without_outliers(const std::vector<double>& off) {
  const double sigma = 1.4826 * quantile(off, 0.5) / 1.7456;  // median of a Rayleigh over its MAD
  const double limit =
      std::max({kOutlierPx, kOutlierSigmas * sigma, quantile(off, 1 - kMostOutliers)});
  std::vector<bool> used;
  for (const double value : off) used.push_back(value <= limit);
  return used;
}

Eigen::Vector3d local_from_board(const Eigen::Vector3d& direction) {
  return {direction.x(), -direction.y(), -direction.z()};
}

void set_view(PlaneView& view, const SampleArea& area) {
  const Eigen::Vector3d camera = view.camera_from_board.inverse().translation;
  const auto direction_from = [&](double x, double y) {
    const Eigen::Vector3d place(
        area.left_mm + x * area.width_mm, area.top_mm + y * area.height_mm, -area.lift_mm);
    return local_from_board(camera - place * kMillimetre).normalized();
  };
  view.view_direction = direction_from(0.5, 0.5);
  for (const double x : {0.0, 1.0}) {
    for (const double y : {0.0, 1.0}) {
      const Eigen::Vector3d other = direction_from(x, y);
      view.view_spread_rad = std::max(
          view.view_spread_rad,
          std::atan2(other.cross(view.view_direction).norm(), other.dot(view.view_direction)));
    }
  }
}

struct LensFit {
  CameraLens lens;
  double rms_px = std::numeric_limits<double>::infinity();
};

/// From a start, or with the focal length held.
LensFit fit_lens(const std::vector<FoundMarks>& views,
                 int width,
                 int height,
                 const CameraLens& start,
                 bool hold_focal) {
  std::vector<std::vector<cv::Point3f>> places;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const FoundMarks& view : views) {
    places.emplace_back();
    pixels.emplace_back();
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      places.back().emplace_back(
          static_cast<float>(view.board_mm[i].x()), static_cast<float>(view.board_mm[i].y()), 0.0F);
      pixels.back().push_back(to_opencv(view.pixels[i]));
    }
  }
  cv::Mat matrix = camera_matrix(start);
  cv::Mat bending = (cv::Mat_<double>(1, 5) << start.k1, start.k2, 0, 0, 0);
  int flags = cv::CALIB_USE_INTRINSIC_GUESS | cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K3 |
              cv::CALIB_FIX_ASPECT_RATIO;
  if (views.size() < kViewsForAll)
    flags |= cv::CALIB_FIX_PRINCIPAL_POINT | cv::CALIB_FIX_K1 | cv::CALIB_FIX_K2;
  if (hold_focal) flags |= cv::CALIB_FIX_FOCAL_LENGTH;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  LensFit fit;
  fit.rms_px = cv::calibrateCamera(places,
                                   pixels,
                                   {width, height},
                                   matrix,
                                   bending,
                                   rotations,
                                   translations,
                                   flags,
                                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 200, 1e-10});
  fit.lens = {.focal_px = {matrix.at<double>(0, 0), matrix.at<double>(1, 1)},
              .principal_point = {matrix.at<double>(0, 2) + kPixelCentre,
                                  matrix.at<double>(1, 2) + kPixelCentre},
              .k1 = bending.at<double>(0),
              .k2 = bending.at<double>(1)};
  return fit;
}

/// In parts of the focal length: by how much worse corners fit if it is wrong. What OpenCV itself
/// says of it is from a pseudo-inverse, and good where nothing is known.
double focal_sigma(const std::vector<FoundMarks>& views,
                   int width,
                   int height,
                   const LensFit& fit) {
  double corners = 0;
  for (const FoundMarks& view : views) corners += static_cast<double>(view.pixels.size());
  double least = std::numeric_limits<double>::infinity();
  for (const double factor : {1 - kFocalTrial, 1 + kFocalTrial}) {
    CameraLens wrong = fit.lens;
    wrong.focal_px *= factor;
    const double rms = fit_lens(views, width, height, wrong, true).rms_px;
    least = std::min(least, rms * rms - fit.rms_px * fit.rms_px);
  }
  const double coordinate = std::max(fit.rms_px, kLeastCornerRms) / std::sqrt(2.0);
  const double chi2 = corners * std::max(least, 0.0) / (coordinate * coordinate);
  return chi2 > 0 ? kFocalTrial / std::sqrt(chi2) : std::numeric_limits<double>::infinity();
}

}  // namespace

Result<CameraLens> calibrate_lens(const std::vector<FoundMarks>& views, int width, int height) {
  if (views.empty() || width < 1 || height < 1) {
    return fail(Errc::kNotFound,
                "finding the lens: {} views of {} x {} pixels; one at least is needed",
                views.size(),
                width,
                height);
  }
  for (const FoundMarks& view : views) VENEER_TRY(check_marks(view));
  LensFit best;
  // The start matters where views are few: a wide, a normal and two long lenses.
  for (const double start : {0.8, 1.6, 3.2, 6.4}) {
    try {
      const double focal = start * std::max(width, height);
      const CameraLens lens{.focal_px = {focal, focal},
                            .principal_point = {0.5 * width, 0.5 * height}};
      const LensFit fit = fit_lens(views, width, height, lens, false);
      if (check_lens(fit.lens) && fit.rms_px < best.rms_px) best = fit;
    } catch (const cv::Exception&) {
      continue;  // what it throws at is a start that leads nowhere
    }
  }
  if (!std::isfinite(best.rms_px)) {
    return fail(Errc::kBadFormat,
                "finding the lens from {} views: no start converges; give [lens] in the plan, or "
                "more views that are tilted to different sides",
                views.size());
  }
  if (!(best.rms_px <= kMostResidualPx)) {
    return fail(Errc::kBadFormat,
                "finding the lens from {} views: the corners are off by {:.2f} px, {} are allowed; "
                "check the plan's [board], above all square_mm, columns and rows",
                views.size(),
                best.rms_px,
                kMostResidualPx);
  }
  double sigma = std::numeric_limits<double>::infinity();
  try {
    sigma = focal_sigma(views, width, height, best);
  } catch (const cv::Exception& error) {
    return fail(Errc::kBadFormat, "finding the lens: OpenCV says {}", error.what());
  }
  if (!(sigma < kFocalSigma)) {
    return fail(Errc::kBadFormat,
                "finding the lens from {} views: the focal length of {:.0f} px is known only to "
                "{:.0f} %; give [lens] in the plan, or take views that are tilted by 30 degrees "
                "and more",
                views.size(),
                best.lens.focal_px.x(),
                std::min(100.0, 100 * sigma));
  }
  return best.lens;
}

Result<PlaneView> locate_plane(const FoundMarks& marks,
                               const CameraLens& lens,
                               const SampleArea& area) {
  VENEER_TRY(check_lens(lens));
  VENEER_TRY(check_marks(marks));
  PlaneView view;
  view.lens = lens;
  std::vector<bool> used(marks.pixels.size(), true);
  std::vector<double> off;
  try {
    view.camera_from_board = pose_of(marks, lens, used);
    used = without_outliers(residuals(marks, lens, view.camera_from_board));
    view.camera_from_board = pose_of(marks, lens, used);
    off = residuals(marks, lens, view.camera_from_board);
  } catch (const cv::Exception& error) {
    return fail(Errc::kBadFormat, "locating the board: OpenCV says {}", error.what());
  }
  view.rms_px = root_mean_square(off, used);
  for (std::size_t i = 0; i < off.size(); ++i)
    if (used[i]) view.worst_px = std::max(view.worst_px, off[i]);
  if (!(view.rms_px <= kMostResidualPx)) {
    return fail(Errc::kBadFormat,
                "locating the board: its {} corners are off by {:.2f} px (root mean square), {} "
                "are allowed; with focal lengths {:.0f} and {:.0f} px, principal point {:.1f}, "
                "{:.1f}, k1 {}, k2 {} no pose fits: check the plan's [lens] and [board]",
                off.size(),
                view.rms_px,
                kMostResidualPx,
                lens.focal_px.x(),
                lens.focal_px.y(),
                lens.principal_point.x(),
                lens.principal_point.y(),
                lens.k1,
                lens.k2);
  }
  set_view(view, area);
  return view;
}

}  // namespace veneer::capture
