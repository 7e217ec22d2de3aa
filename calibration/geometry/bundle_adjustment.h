// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "calibration/geometry/board.h"
#include "calibration/geometry/lens.h"

namespace veneer::geometry {

/// How much a point counts that lies far from where it is expected.
enum class Loss {
  kNone,    ///< by the square
  kHuber,   ///< linearly beyond GeometryOptions::loss_px
  kCauchy,  ///< by the logarithm beyond it: for sets with gross errors
};

struct GeometryOptions {
  int camera_width = 0;  ///< pixels; above 0, like the next three
  int camera_height = 0;
  int projector_width = 0;
  int projector_height = 0;
  LensModel camera_model = LensModel::kRadial;
  LensModel projector_model = LensModel::kRadial;
  /// Huber's leaves a set whose points are all within loss_px as the plain squares have it.
  Loss loss = Loss::kHuber;
  double loss_px = 2;
  /// Views whose planes turn less than this against each other count as one orientation.
  double least_turn_deg = 5;
  /// A focal length whose standard deviation exceeds this part of it is refused.
  double most_focal_deviation = 0.05;
  /// A fit that leaves more than this, root mean square in pixels, is refused: it is none.
  double most_rms_px = 5;
  /// Repeat the fit without each view in turn.
  bool leave_one_out = true;

  [[nodiscard]] Status check() const;  ///< Errors: kInvalidOption
};

/// Standard deviations of the parameters of a Lens: 0 for those that are not fitted.
struct LensDeviations {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
};

/// One view in the fit over all of them, and as predicted by a fit that did not see it.
struct ViewQuality {
  std::string name;
  int camera_points = 0;
  int projector_points = 0;
  double camera_rms_px = 0;  ///< root mean square of the distances, as in all of these
  double projector_rms_px = 0;
  int outliers = 0;  ///< points further off than three times loss_px
};

/// What comes out without one of the views.
struct LeftOut {
  std::string name;            ///< of the view that was left out
  double camera_focal = 0;     ///< fx, pixels
  double projector_focal = 0;  ///< fx, pixels
  RigidTransform projector_from_camera;
  double stereo_rms_px = 0;  ///< of the remaining views
  /// The view that was left out: its pose is found from the camera's points alone; the projector's
  /// points are then predicted, and nothing of theirs was fitted.
  double held_out_camera_rms_px = 0;
  double held_out_projector_rms_px = 0;
};

/// Where the fit ended when it began elsewhere.
struct StartCheck {
  std::string name;  ///< such as "focal lengths 30 % too long"
  double stereo_rms_px = 0;
  int iterations = 0;
  /// Largest difference of a focal length, a principal point, or a coordinate of the translation,
  /// relative to the focal length or to the translation's length.
  double disagreement = 0;
};

/// A projector as a plain pinhole, which is what a profile holds: fitted with the camera and the
/// views' poses where the full fit has them.
struct PinholeProjector {
  Lens lens;  ///< without distortion
  RigidTransform projector_from_camera;
  double projector_rms_px = 0;  ///< to be compared with GeometryCalibration::projector_rms_px
  /// Largest distance between where this and the full model send a point, projector pixels, over
  /// the part of the raster that the views cover and at their mean distance.
  double most_off_px = 0;
};

struct GeometryCalibration {
  Lens camera;
  Lens projector;
  RigidTransform projector_from_camera;
  std::vector<RigidTransform> camera_from_object;     ///< one a view
  std::vector<RigidTransform> projector_from_object;  ///< projector_from_camera * the above
  PinholeProjector pinhole;

  // Lengths are in the unit of the views' points.
  double camera_rms_px = 0;  ///< of the camera calibrated alone, as OpenCV's calibrateCamera has it
  double projector_rms_px = 0;  ///< of the projector's points in the joint fit
  double stereo_rms_px =
      0;  ///< over the points of both in the joint fit, as OpenCV's stereoCalibrate
  LensDeviations camera_deviations;
  LensDeviations projector_deviations;
  Eigen::Vector3d translation_deviations = Eigen::Vector3d::Zero();  ///< of projector_from_camera
  Eigen::Vector3d rotation_deviations_rad = Eigen::Vector3d::Zero();
  std::vector<ViewQuality> views;
  std::vector<LeftOut>
      left_out;  ///< empty where asked for none or where there are fewer than 4 views
  /// Root mean square over all views as each was predicted without it; 0 where left_out is empty.
  double held_out_camera_rms_px = 0;
  double held_out_projector_rms_px = 0;
  std::vector<StartCheck> starts;
  double start_disagreement = 0;  ///< the largest of `starts`
  std::vector<std::string> warnings;
};

/// A starting point or somebody else's result.
struct Rig {
  Lens camera;
  Lens projector;
  RigidTransform projector_from_camera;
};

/// Both lenses and the pose between them from views of one object in several poses: the least
/// (robust) sum of squared distances, in camera and projector pixels alike, to convergence. Fixed
/// seed; one thread; the same answer on every run. Errors: kInvalidOption (options; fewer than 3
/// views; a view with points missing), kBadFormat (the views cannot tell the lens: planes that are
/// all parallel or nearly so, a focal length too uncertain, points that no start explains; the text
/// says which and what to do).
[[nodiscard]] Result<GeometryCalibration> calibrate_geometry(std::span<const View> views,
                                                             const GeometryOptions& options,
                                                             Progress& progress);

/// The pictures of one pose of the board, in the plan's order.
struct PoseCapture {
  std::string name;
  std::vector<GreyPicture> pictures;
};

/// The same from pictures: observe_board() for each pose, then calibrate_geometry().
/// Who is short of memory observes pose by pose and keeps the views.
struct BoardCalibration {
  std::vector<BoardView> observed;  ///< one a pose
  GeometryCalibration geometry;
};
[[nodiscard]] Result<BoardCalibration> calibrate_geometry_from_pictures(
    std::span<const PoseCapture> poses,
    const PatternPlan& plan,
    const Board& board,
    const BoardOptions& board_options,
    const GeometryOptions& options,
    Progress& progress);

/// How well a rig explains the views if only their poses are fitted, and whether it had converged.
struct RigEvaluation {
  double stereo_rms_px = 0;  ///< with its parameters, poses of the object fitted
  double camera_rms_px = 0;
  double projector_rms_px = 0;
  double optimum_rms_px = 0;      ///< that a fit of all parameters reaches from it
  double focal_change = 0;        ///< relative, of the projector's fx, on the way there
  double translation_change = 0;  ///< relative to the translation's length
  bool converged = false;         ///< optimum within 1 % of stereo_rms_px
};
/// Errors: as of calibrate_geometry().
[[nodiscard]] Result<RigEvaluation> evaluate_rig(const Rig& rig,
                                                 std::span<const View> views,
                                                 const GeometryOptions& options);

/// A calibration_result.xml as procam-calibration writes it (OpenCV's storage: cam_int, cam_dist,
/// proj_int, proj_dist, "roration" or rotation, translation). Errors: kNotFound, kBadFormat.
[[nodiscard]] Result<Rig> read_opencv_rig(const std::filesystem::path& path);

}  // namespace veneer::geometry
