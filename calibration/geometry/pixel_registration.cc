// SPDX-License-Identifier: Apache-2.0
#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calibration/geometry/internal_ceres.h"
#include "calibration/geometry/internal_consensus.h"
#include "calibration/geometry/internal_joint_fit.h"
#include "calibration/geometry/internal_pose_block.h"
#include "calibration/geometry/internal_projection.h"
#include "calibration/geometry/registration.h"

namespace veneer::geometry {
namespace {

constexpr std::size_t kLeastTouches = 6;
constexpr std::size_t kSubset = 6;  // that a pose is found from
/// Median length of a vector whose two coordinates are normal with deviation 1.
constexpr double kUsualMedian = 1.177;
constexpr int kRefits = 4;  // after which the set of inliers does not change any more
/// Of the second extent of the touched points to the first, below which they are on a line.
constexpr double kLeastExtentRatio = 0.02;

/// Of a touch on the raster: of the hand's aim, and of the tracker's at the touch's distance.
double deviation_of(const PixelTouch& touch,
                    const Lens& lens,
                    const RigidTransform& projector_from_world,
                    const PixelRegistrationOptions& options) {
  const double depth = (projector_from_world * touch.x_in_world).z();
  return std::hypot(options.pixel_deviation_px,
                    lens.fx * touch.deviation_m / std::max(depth, touch.deviation_m));
}

double distance_px(const PixelTouch& touch,
                   const Lens& lens,
                   const RigidTransform& projector_from_world) {
  const double distance =
      (lens.project(projector_from_world * touch.x_in_world) - touch.pixel).norm();
  return std::isfinite(distance) ? distance : 1e9;  // behind the projector
}

std::vector<double> distances_of(std::span<const PixelTouch> touches,
                                 const Lens& lens,
                                 const RigidTransform& projector_from_world,
                                 const PixelRegistrationOptions& options) {
  std::vector<double> distances;
  for (const PixelTouch& touch : touches)
    distances.push_back(distance_px(touch, lens, projector_from_world) /
                        deviation_of(touch, lens, projector_from_world, options));
  return distances;
}

std::optional<RigidTransform> pose_from(std::span<const PixelTouch> touches,
                                        std::span<const std::size_t> used,
                                        const Lens& lens) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  for (const std::size_t i : used) {
    points.push_back(touches[i].x_in_world);
    pixels.push_back(touches[i].pixel);
  }
  return pose_of(points, pixels, lens);
}

struct TouchResidual {
  PixelTouch touch;
  std::array<double, 9> lens;
  double deviation_px;

  template <class T>
  bool operator()(const T* world_from_projector, T* residual) const {
    T relative[3];
    for (int i = 0; i < 3; ++i) relative[i] = T(touch.x_in_world[i]) - world_from_projector[3 + i];
    const T back[3] = {
        -world_from_projector[0], -world_from_projector[1], -world_from_projector[2]};
    T in_projector[3];
    ceres::AngleAxisRotatePoint(back, relative, in_projector);
    T pixel[2];
    if (!project_with(lens.data(), in_projector, pixel)) return false;
    for (int i = 0; i < 2; ++i) residual[i] = (pixel[i] - T(touch.pixel[i])) / T(deviation_px);
    return true;
  }
};

/// @param result  where given, its deviations are filled in.
void refine(std::span<const PixelTouch> touches,
            std::span<const std::size_t> used,
            const Lens& lens,
            const PixelRegistrationOptions& options,
            RigidTransform& projector_from_world,
            PixelRegistration* result) {
  PoseBlock block = block_of(projector_from_world.inverse());
  ceres::Problem problem;
  for (const std::size_t i : used) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<TouchResidual, 2, 6>(new TouchResidual{
                                 touches[i],
                                 lens.coefficients(),
                                 deviation_of(touches[i], lens, projector_from_world, options)}),
                             nullptr,
                             block.data());
  }
  ceres::Solver::Summary summary;
  ceres::Solve(tight_options(), &problem, &summary);
  if (!summary.IsSolutionUsable()) return;
  projector_from_world = pose_of(block).inverse();
  if (result == nullptr) return;
  // Deviations that were stated too small do not make the answer better than it is.
  const double scale = std::sqrt(std::max(1.0, variance_of(problem).value_or(1)));
  const auto deviations = deviations_of(problem, {block.data()});
  if (!deviations) return;
  const std::vector<double>& d = deviations->front();
  result->rotation_deviation_rad = scale * std::max({d[0], d[1], d[2]});
  result->position_deviation_m = scale * std::max({d[3], d[4], d[5]});
}

Status check_touches(std::span<const PixelTouch> touches, const Lens& lens) {
  if (!(lens.fx > 0) || !(lens.fy > 0)) {
    return fail(Errc::kInvalidOption,
                "registering touched pixels: focal lengths of {} and {} pixels; calibrate the "
                "projector's lens first",
                lens.fx,
                lens.fy);
  }
  if (touches.size() < kLeastTouches) {
    return fail(Errc::kInvalidOption,
                "registering touched pixels: {} touches; at least {} are needed, better 10 to 20",
                touches.size(),
                kLeastTouches);
  }
  for (std::size_t i = 0; i < touches.size(); ++i) {
    const PixelTouch& touch = touches[i];
    if (!touch.pixel.allFinite() || !touch.x_in_world.allFinite() || !(touch.deviation_m > 0)) {
      return fail(Errc::kInvalidOption,
                  "registering touched pixels: touch {} is no number, or its deviation of {} m not "
                  "above 0",
                  i,
                  touch.deviation_m);
    }
  }
  return {};
}

Status check_extent(std::span<const PixelTouch> touches, std::span<const std::size_t> used) {
  std::vector<Eigen::Vector3d> points;
  for (const std::size_t i : used) points.push_back(touches[i].x_in_world);
  const Eigen::Vector3d extents = extents_of(points);
  if (extents[1] > kLeastExtentRatio * extents[0]) return {};
  return fail(Errc::kBadFormat,
              "registering touched pixels: the touched points lie within {:.1f} mm of one line, "
              "which leaves open where the projector stands about it; spread the cross-hairs over "
              "the whole picture and the scene's depth",
              1e3 * extents[1]);
}

}  // namespace

Status PixelRegistrationOptions::check() const {
  if (!(pixel_deviation_px > 0) || !(most_deviations > 0)) {
    return fail(Errc::kInvalidOption,
                "registering touched pixels: pixel_deviation_px is {} and most_deviations {}; both "
                "have to be above 0",
                pixel_deviation_px,
                most_deviations);
  }
  return {};
}

Result<PixelRegistration> register_pixels(std::span<const PixelTouch> touches,
                                          const Lens& lens,
                                          const PixelRegistrationOptions& options) {
  VENEER_TRY(options.check());
  VENEER_TRY(check_touches(touches, lens));
  std::vector<std::size_t> used(touches.size());
  for (std::size_t i = 0; i < used.size(); ++i) used[i] = i;
  VENEER_TRY(check_extent(touches, used));
  const auto start = least_median<RigidTransform>(
      touches.size(),
      kSubset,
      [&](std::span<const std::size_t> subset) { return pose_from(touches, subset, lens); },
      [&](const RigidTransform& pose) { return distances_of(touches, lens, pose, options); });
  if (!start) {
    return fail(Errc::kBadFormat,
                "registering touched pixels: no place of the projector explains the touches; check "
                "that points are in metres and in the order of the cross-hairs");
  }
  RigidTransform projector_from_world = *start;
  PixelRegistration result;
  for (int i = 0; i < kRefits; ++i) {
    const Agreement agreement =
        agreement_of(distances_of(touches, lens, projector_from_world, options),
                     kUsualMedian,
                     options.most_deviations);
    result.inlier = agreement.inlier;
    used.clear();
    for (std::size_t k = 0; k < touches.size(); ++k)
      if (agreement.inlier[k]) used.push_back(k);
    if (used.size() < kLeastTouches || 2 * used.size() <= touches.size()) {
      return fail(Errc::kBadFormat,
                  "registering touched pixels: only {} of {} touches agree on a place of the "
                  "projector; check that points are in metres and in the order of the cross-hairs, "
                  "and that nothing moved",
                  used.size(),
                  touches.size());
    }
    refine(touches, used, lens, options, projector_from_world, &result);
  }
  VENEER_TRY(check_extent(touches, used));
  result.world_from_projector = projector_from_world.inverse();
  for (const PixelTouch& touch : touches)
    result.distance_px.push_back(distance_px(touch, lens, projector_from_world));
  double squares = 0;
  double held_out = 0;
  for (const std::size_t out : used) {
    squares += result.distance_px[out] * result.distance_px[out];
    std::vector<std::size_t> rest = used;
    std::erase(rest, out);
    RigidTransform others = projector_from_world;
    refine(touches, rest, lens, options, others, nullptr);
    const double distance = distance_px(touches[out], lens, others);
    held_out += distance * distance;
  }
  result.rms_px = std::sqrt(squares / static_cast<double>(used.size()));
  result.held_out_px = std::sqrt(held_out / static_cast<double>(used.size()));
  if (used.size() < touches.size()) {
    result.warnings.push_back(fmt::format("{} of {} touches are far off and were left out",
                                          touches.size() - used.size(),
                                          touches.size()));
  }
  return result;
}

}  // namespace veneer::geometry
