// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/rigid_transform.h"
#include "calibration/geometry/lens.h"
#include "tracking/synchronised.h"

namespace veneer::geometry {

// Lengths are metres. Everything is deterministic: fixed seeds, one thread.

/// A point that is known in one frame and was touched in another.
struct PointPair {
  Eigen::Vector3d x_in_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d x_in_b = Eigen::Vector3d::Zero();
  /// Standard deviation of the touched point; pairs count by its inverse square. Above 0.
  double deviation_m = 1e-3;
};

/// What a touched stylus tip gives: the tip in the world, with the deviation that the tracker's
/// deviations of place and turning make at the tip.
/// @param tip_in_sensor  the tip in the sensor's frame.
struct TouchedPoint {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  double deviation_m = 0;
};
[[nodiscard]] TouchedPoint touched_point(const tracking::SynchronisedPose& stylus,
                                         const Eigen::Vector3d& tip_in_sensor);

struct PointRegistrationOptions {
  /// A pair is an outlier if it is off by more than this many of its deviations, or of the scatter
  /// of the inliers where that is larger.
  double most_deviations = 4;
  /// Least size of the set across its thinnest wanted direction: the second extent (root mean
  /// square about the line that fits best). Points on a line leave the turning about it open.
  double least_extent_m = 0.02;

  [[nodiscard]] Status check() const;
};

struct PointRegistration {
  RigidTransform b_from_a;
  double rms_m = 0;                   ///< of the inliers' distances
  double held_out_m = 0;              ///< root mean square, each inlier predicted by the others
  double position_deviation_m = 0;    ///< standard deviation of a coordinate of the points' centre
  double rotation_deviation_rad = 0;  ///< largest standard deviation of a turning
  std::vector<bool> inlier;           ///< one a pair
  std::vector<double> distance_m;     ///< one a pair
  std::vector<std::string> warnings;
};

/// b_from_a from pairs, by consensus and then the closed form on the inliers.
/// Source: Umeyama 1991, "Least-Squares Estimation of Transformation Parameters Between Two Point
/// Patterns", eqs. (39) to (42), without scale.
/// Errors: kInvalidOption (fewer than 4 pairs, or not finite), kBadFormat (points on a line; fewer
/// than half of the pairs agree; the text says what to do).
[[nodiscard]] Result<PointRegistration> register_points(
    std::span<const PointPair> pairs, const PointRegistrationOptions& options = {});

/// A board seen by the projector-camera pair while a tracked sensor is fixed to it.
struct BoardPose {
  std::string name;
  RigidTransform projector_from_board;
  tracking::SynchronisedPose world_from_sensor;
};

struct BoardRegistrationOptions {
  /// Deviations of projector_from_board itself, which count beside the tracker's.
  double position_deviation_m = 1e-3;
  double rotation_deviation_rad = 1e-3;
  /// A pose is an outlier beyond so many deviations (or scatters of the inliers).
  double most_deviations = 4;
  /// The turnings between the poses must reach this about two axes at least.
  double least_turn_deg = 10;

  [[nodiscard]] Status check() const;
};

struct BoardRegistration {
  RigidTransform world_from_projector;
  RigidTransform board_from_sensor;
  double position_rms_m = 0;  ///< of the inliers: between the sensor's place as tracked and as seen
  double rotation_rms_rad = 0;
  double held_out_position_m = 0;  ///< root mean square, each inlier predicted by the others
  double held_out_rotation_rad = 0;
  std::vector<bool> inlier;                ///< one a pose
  std::vector<double> position_error_m;    ///< one a pose
  std::vector<double> rotation_error_rad;  ///< one a pose
  double position_deviation_m = 0;         ///< of world_from_projector's origin, largest coordinate
  double rotation_deviation_rad = 0;       ///< of world_from_projector
  std::vector<std::string> warnings;
};

/// world_from_projector and board_from_sensor, such that for every pose
///   world_from_sensor = world_from_projector * projector_from_board * board_from_sensor.
/// Source: the equation AX = ZB of Zhuang, Roth and Sudhakar 1994, "Simultaneous Robot/World and
/// Tool/Flange Calibration"; linear start, then refined over all.
/// Errors: kInvalidOption (fewer than 4 poses, or not finite), kBadFormat (no turnings about two
/// axes; fewer than half of the poses agree).
[[nodiscard]] Result<BoardRegistration> register_boards(
    std::span<const BoardPose> poses, const BoardRegistrationOptions& options = {});

/// A cross-hair that the projector shows at a pixel, and where it was touched on the scene.
struct PixelTouch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< first centre (0.5, 0.5)
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  double deviation_m = 1e-3;  ///< of the touched point
};

struct PixelRegistrationOptions {
  double pixel_deviation_px = 0.5;  ///< how well a person hits the middle of a cross-hair
  double most_deviations = 4;       ///< beyond which a touch is an outlier

  [[nodiscard]] Status check() const;
};

struct PixelRegistration {
  RigidTransform world_from_projector;
  double rms_px = 0;       ///< of the inliers
  double held_out_px = 0;  ///< root mean square, each inlier predicted by the others
  std::vector<bool> inlier;
  std::vector<double> distance_px;
  double position_deviation_m = 0;  ///< of the projector's place, largest coordinate
  double rotation_deviation_rad = 0;
  std::vector<std::string> warnings;
};

/// The projector's pose from touched cross-hairs; its lens is known.
/// Errors: kInvalidOption (fewer than 6 touches, or not finite), kBadFormat (the points lie on a
/// line; fewer than half of the touches agree).
[[nodiscard]] Result<PixelRegistration> register_pixels(
    std::span<const PixelTouch> touches,
    const Lens& lens,
    const PixelRegistrationOptions& options = {});

}  // namespace veneer::geometry
