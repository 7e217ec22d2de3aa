// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rigid_transform.h"
#include "calibration/geometry/bundle_adjustment.h"

namespace veneer::geometry {

/// All unknowns of a projector, a camera and an object in several poses.
struct Estimate {
  Rig rig;
  std::vector<RigidTransform> camera_from_object;  ///< one a view
};

/// What a fit may move.
enum class Moving {
  kAll,        ///< lenses, the pose between them, and the views' poses
  kViews,      ///< the views' poses alone
  kProjector,  ///< the projector's lens and pose alone
};

/// What a fit may move and what it looks at.
struct FitModel {
  LensModel camera_model = LensModel::kRadial;
  LensModel projector_model = LensModel::kRadial;
  bool use_projector = true;  ///< false: the camera's points alone
  Moving moving = Moving::kAll;
  Loss loss = Loss::kHuber;
  double loss_px = 2;
};

struct FitOutcome {
  int iterations = 0;
  bool solved = false;  ///< false: the start is no start (points behind a lens)
};

/// Sums of squared distances of the points that were seen, of a view or of several.
struct Errors {
  double camera_squares = 0;
  double projector_squares = 0;
  int camera_points = 0;
  int projector_points = 0;
  int outliers = 0;  ///< beyond the distance that was asked with

  void add(const Errors& other);
  [[nodiscard]] double camera_rms() const;  ///< 0 without points, like the next two
  [[nodiscard]] double projector_rms() const;
  [[nodiscard]] double stereo_rms() const;
};

/// Moves `estimate` to the nearest minimum, until the arithmetic ends.
FitOutcome fit_jointly(std::span<const View> views, const FitModel& model, Estimate& estimate);

[[nodiscard]] Errors errors_of(const View& view,
                               const Rig& rig,
                               const RigidTransform& camera_from_object,
                               double outlier_px);
[[nodiscard]] Errors errors_of(std::span<const View> views, const Estimate& estimate);

/// As many views as a fit needs, each with enough points. Errors: kInvalidOption.
[[nodiscard]] Status check_views(std::span<const View> views);

/// The fit of all unknowns that the options ask for.
[[nodiscard]] FitModel joint_model(const GeometryOptions& options);

/// Standard deviations at a minimum, from the curvature there and the residuals' own size; absent
/// where the views leave a direction open.
struct Deviations {
  LensDeviations camera;
  LensDeviations projector;
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};
[[nodiscard]] std::optional<Deviations> deviations_at(std::span<const View> views,
                                                      const FitModel& model,
                                                      const Estimate& estimate);

/// camera_from_object by the camera's points alone, the lens being known; absent without a
/// solution.
[[nodiscard]] std::optional<RigidTransform> pose_of(std::span<const Eigen::Vector3d> points,
                                                    std::span<const Eigen::Vector2d> pixels,
                                                    const Lens& lens);

/// Where a fit may begin. The first is in closed form; the others are away from it, with fixed
/// seed.
struct Start {
  std::string name;
  Estimate estimate;
};
/// The camera's focal length by trial, poses by the planes' homographies.
[[nodiscard]] std::optional<Estimate> initial_camera(std::span<const View> views,
                                                     const GeometryOptions& options);
/// The projector's lens and pose by the direct linear transformation from a camera that is fitted;
/// and the other starts.
[[nodiscard]] std::vector<Start> starts_from(std::span<const View> views,
                                             const GeometryOptions& options,
                                             const Estimate& camera_alone);

}  // namespace veneer::geometry
