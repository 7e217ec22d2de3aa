// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <opencv2/calib3d.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/random.h"
#include "calibration/geometry/internal_joint_fit.h"

namespace veneer::geometry {
namespace {

/// Focal lengths that are tried, in widths of the picture: from a fisheye's to a long lens.
constexpr std::array kFocalTrials{0.4, 0.6, 0.8, 1.1, 1.5, 2.0, 2.7, 3.7, 5.0, 7.0};
constexpr std::uint64_t kShakeSeed = 20;
constexpr double kShakenFocal = 0.1;    // of the focal length
constexpr double kShakenCentre = 0.03;  // of the raster
constexpr double kShakenTurn_rad = 0.05;
constexpr double kShakenDistance = 0.05;  // of the distance

/// The points of all views in the camera's frame, with the projector's pixels.
struct LitPoints {
  std::vector<Eigen::Vector3d> x_in_camera;
  std::vector<Eigen::Vector2d> pixels;
};

LitPoints lit_points(std::span<const View> views, const std::vector<RigidTransform>& poses) {
  LitPoints lit;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t i = 0; i < views[v].x_in_object.size(); ++i) {
      if (!views[v].projector[i].allFinite()) continue;
      lit.x_in_camera.push_back(poses[v] * views[v].x_in_object[i]);
      lit.pixels.push_back(views[v].projector[i]);
    }
  }
  return lit;
}

/// A pinhole and its pose from points that are not in one plane; absent where they are, or where no
/// pinhole comes out. Source: Abdel-Aziz and Karara 1971, "Direct Linear Transformation from
/// Comparator Coordinates into Object Space Coordinates in Close-Range Photogrammetry".
struct Pinhole {
  Lens lens;
  RigidTransform lens_from_points;
};
std::optional<Pinhole> direct_linear(const LitPoints& lit) {
  const std::size_t count = lit.pixels.size();
  if (count < 6) return std::nullopt;
  // Centred and scaled, after Hartley 1997, so that the equations are well conditioned.
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Eigen::Vector2d pixel_middle = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    middle += lit.x_in_camera[i] / static_cast<double>(count);
    pixel_middle += lit.pixels[i] / static_cast<double>(count);
  }
  double size = 0;
  double pixel_size = 0;
  for (std::size_t i = 0; i < count; ++i) {
    size += (lit.x_in_camera[i] - middle).norm() / static_cast<double>(count);
    pixel_size += (lit.pixels[i] - pixel_middle).norm() / static_cast<double>(count);
  }
  if (!(size > 0) || !(pixel_size > 0)) return std::nullopt;
  Eigen::Matrix<double, 12, 12> normal = Eigen::Matrix<double, 12, 12>::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector4d x = ((lit.x_in_camera[i] - middle) / size).homogeneous();
    const Eigen::Vector2d u = (lit.pixels[i] - pixel_middle) / pixel_size;
    Eigen::Matrix<double, 2, 12> rows = Eigen::Matrix<double, 2, 12>::Zero();
    rows.block<1, 4>(0, 0) = x.transpose();
    rows.block<1, 4>(0, 8) = -u.x() * x.transpose();
    rows.block<1, 4>(1, 4) = x.transpose();
    rows.block<1, 4>(1, 8) = -u.y() * x.transpose();
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 12, 12>> solver(normal);
  const Eigen::Matrix<double, 12, 1> p = solver.eigenvectors().col(0);
  Eigen::Matrix<double, 3, 4> matrix;
  matrix << p.segment<4>(0).transpose(), p.segment<4>(4).transpose(), p.segment<4>(8).transpose();
  Eigen::Matrix3d pixels_back;
  pixels_back << pixel_size, 0, pixel_middle.x(), 0, pixel_size, pixel_middle.y(), 0, 0, 1;
  Eigen::Matrix4d points_forth = Eigen::Matrix4d::Identity() / size;
  points_forth.topRightCorner<3, 1>() = -middle / size;
  points_forth(3, 3) = 1;
  matrix = pixels_back * matrix * points_forth;
  // The middle has to lie in front.
  if (matrix.row(2).dot(middle.homogeneous()) < 0) matrix = -matrix;

  // matrix = K (R | t), K upper triangular: the QR of the inverse has them in reverse.
  const Eigen::Matrix3d inverse = matrix.leftCols<3>().inverse();
  if (!inverse.allFinite()) return std::nullopt;
  const Eigen::HouseholderQR<Eigen::Matrix3d> qr(inverse);
  Eigen::Matrix3d rotation = Eigen::Matrix3d(qr.householderQ()).transpose();
  Eigen::Matrix3d k = Eigen::Matrix3d(qr.matrixQR().triangularView<Eigen::Upper>()).inverse();
  for (int i = 0; i < 3; ++i) {
    if (k(i, i) >= 0) continue;
    k.col(i) = -k.col(i);
    rotation.row(i) = -rotation.row(i);
  }
  if (!k.allFinite() || rotation.determinant() < 0) return std::nullopt;
  Pinhole pinhole;
  pinhole.lens_from_points.rotation = Eigen::Quaterniond(rotation);
  pinhole.lens_from_points.translation = k.inverse() * matrix.col(3);
  k /= k(2, 2);
  pinhole.lens = {k(0, 0), k(1, 1), k(0, 2), k(1, 2)};
  return pinhole;
}

double squares_of(std::span<const Eigen::Vector3d> points,
                  std::span<const Eigen::Vector2d> pixels,
                  const Lens& lens,
                  const RigidTransform& pose) {
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (pixels[i].allFinite()) sum += (lens.project(pose * points[i]) - pixels[i]).squaredNorm();
  }
  return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

/// The best of the trial focal lengths; `lens` has its principal point already.
std::optional<Pinhole> by_trial(const LitPoints& lit, Lens lens, int width) {
  std::optional<Pinhole> best;
  double least = std::numeric_limits<double>::infinity();
  for (const double trial : kFocalTrials) {
    lens.fx = lens.fy = trial * width;
    const auto pose = pose_of(lit.x_in_camera, lit.pixels, lens);
    if (!pose) continue;
    const double squares = squares_of(lit.x_in_camera, lit.pixels, lens, *pose);
    if (squares >= least) continue;
    least = squares;
    best = Pinhole{lens, *pose};
  }
  return best;
}

/// Poses of the views and of the projector for lenses that are given.
std::optional<Estimate> posed(std::span<const View> views,
                              const Lens& camera,
                              const Lens& projector) {
  Estimate estimate;
  estimate.rig.camera = camera;
  estimate.rig.projector = projector;
  for (const View& view : views) {
    const auto pose = pose_of(view.x_in_object, view.camera, camera);
    if (!pose) return std::nullopt;
    estimate.camera_from_object.push_back(*pose);
  }
  const LitPoints lit = lit_points(views, estimate.camera_from_object);
  const auto pose = pose_of(lit.x_in_camera, lit.pixels, projector);
  if (!pose) return std::nullopt;
  estimate.rig.projector_from_camera = *pose;
  return estimate;
}

Lens scaled(Lens lens, double factor) {
  lens.fx *= factor;
  lens.fy *= factor;
  lens.k1 = lens.k2 = lens.p1 = lens.p2 = lens.k3 = 0;
  return lens;
}

Lens centred(Lens lens, int width, int height) {
  lens = scaled(lens, 1);
  lens.cx = 0.5 * width;
  lens.cy = 0.5 * height;
  return lens;
}

Estimate shaken(Estimate estimate, const GeometryOptions& options) {
  Pcg32 random(kShakeSeed);
  const auto shake = [&] { return 2 * random.uniform() - 1; };
  const auto shake_pose = [&](RigidTransform& pose) {
    const Eigen::Vector3d axis(shake(), shake(), shake());
    pose.rotation =
        Eigen::Quaterniond(Eigen::AngleAxisd(kShakenTurn_rad, axis.normalized())) * pose.rotation;
    const double distance = pose.translation.norm();
    pose.translation += kShakenDistance * distance * Eigen::Vector3d(shake(), shake(), shake());
  };
  const auto shake_lens = [&](Lens& lens, int width, int height) {
    lens = scaled(lens, 1 + kShakenFocal * shake());
    lens.cx += kShakenCentre * width * shake();
    lens.cy += kShakenCentre * height * shake();
  };
  shake_lens(estimate.rig.camera, options.camera_width, options.camera_height);
  shake_lens(estimate.rig.projector, options.projector_width, options.projector_height);
  shake_pose(estimate.rig.projector_from_camera);
  for (RigidTransform& pose : estimate.camera_from_object) shake_pose(pose);
  return estimate;
}

}  // namespace

std::optional<RigidTransform> pose_of(std::span<const Eigen::Vector3d> points,
                                      std::span<const Eigen::Vector2d> pixels,
                                      const Lens& lens) {
  std::vector<cv::Point3d> from;
  std::vector<cv::Point2d> to;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!pixels[i].allFinite()) continue;
    from.emplace_back(points[i].x(), points[i].y(), points[i].z());
    to.emplace_back(pixels[i].x(), pixels[i].y());
  }
  if (from.size() < 6) return std::nullopt;
  const cv::Matx33d k(lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1);
  const cv::Vec<double, 5> distortion(lens.k1, lens.k2, lens.p1, lens.p2, lens.k3);
  cv::Vec3d turn;
  cv::Vec3d shift;
  try {
    if (!cv::solvePnP(from, to, k, distortion, turn, shift, false, cv::SOLVEPNP_ITERATIVE))
      return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // it throws at points that no pose explains
  }
  RigidTransform pose;
  const Eigen::Vector3d rotation(turn[0], turn[1], turn[2]);
  if (rotation.norm() > 0)
    pose.rotation = Eigen::AngleAxisd(rotation.norm(), rotation.normalized());
  pose.translation = {shift[0], shift[1], shift[2]};
  if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) return std::nullopt;
  const bool in_front = std::ranges::all_of(from, [&](const cv::Point3d& point) {
    return (pose * Eigen::Vector3d(point.x, point.y, point.z)).z() > 0;
  });
  if (!in_front) return std::nullopt;
  return pose;
}

std::optional<Estimate> initial_camera(std::span<const View> views,
                                       const GeometryOptions& options) {
  std::optional<Estimate> best;
  double least = std::numeric_limits<double>::infinity();
  for (const double trial : kFocalTrials) {
    Estimate estimate;
    const double focal = trial * options.camera_width;
    estimate.rig.camera = {focal, focal, 0.5 * options.camera_width, 0.5 * options.camera_height};
    double squares = 0;
    for (const View& view : views) {
      const auto pose = pose_of(view.x_in_object, view.camera, estimate.rig.camera);
      if (!pose) break;
      squares += squares_of(view.x_in_object, view.camera, estimate.rig.camera, *pose);
      estimate.camera_from_object.push_back(*pose);
    }
    if (estimate.camera_from_object.size() < views.size() || squares >= least) continue;
    least = squares;
    best = std::move(estimate);
  }
  return best;
}

std::vector<Start> starts_from(std::span<const View> views,
                               const GeometryOptions& options,
                               const Estimate& camera_alone) {
  const LitPoints lit = lit_points(views, camera_alone.camera_from_object);
  Lens middle;
  middle = centred(middle, options.projector_width, options.projector_height);
  std::optional<Pinhole> pinhole = direct_linear(lit);
  const auto plausible = [&](const Pinhole& p) {
    const double shortest = 0.1 * options.projector_width;
    const double longest = 100.0 * options.projector_width;
    return p.lens.fx > shortest && p.lens.fx < longest && p.lens.fy > shortest &&
           p.lens.fy < longest &&
           std::isfinite(squares_of(lit.x_in_camera, lit.pixels, p.lens, p.lens_from_points));
  };
  if (!pinhole || !plausible(*pinhole)) pinhole = by_trial(lit, middle, options.projector_width);
  std::vector<Start> starts;
  if (!pinhole) return starts;

  Estimate closed = camera_alone;
  closed.rig.projector = pinhole->lens;
  closed.rig.projector_from_camera = pinhole->lens_from_points;
  starts.push_back({"closed form", closed});
  const Lens& camera = closed.rig.camera;
  const Lens& projector = closed.rig.projector;
  // Where no pose suits such lenses, the closed form's has to do.
  const auto with_lenses = [&](const Lens& first, const Lens& second) {
    std::optional<Estimate> estimate = posed(views, first, second);
    if (estimate) return *std::move(estimate);
    estimate = closed;
    estimate->rig.camera = first;
    estimate->rig.projector = second;
    return *std::move(estimate);
  };
  starts.push_back(
      {"principal points in the middle",
       with_lenses(centred(camera, options.camera_width, options.camera_height),
                   centred(projector, options.projector_width, options.projector_height))});
  starts.push_back(
      {"focal lengths 30 % too long", with_lenses(scaled(camera, 1.3), scaled(projector, 1.3))});
  starts.push_back(
      {"focal lengths 30 % too short", with_lenses(scaled(camera, 0.7), scaled(projector, 0.7))});
  starts.push_back({"everything shaken", shaken(closed, options)});
  return starts;
}

}  // namespace veneer::geometry
