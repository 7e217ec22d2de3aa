// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <functional>

#include "base/rigid_transform.h"
#include "capture/development/hdr_merge.h"
#include "capture/plan.h"

namespace veneer::capture::testing {

/// What a camera is to see of a board: traced through its own copy of the lens, which it inverts by
/// bisection, so that it shares nothing with what it judges but the board's drawing.
struct BoardScene {
  MarkBoard board;
  CameraLens lens{.focal_px = {2200, 2200}, .principal_point = {320, 240}};
  int width = 640, height = 480;
  RigidTransform camera_from_board;
  /// Light of a place on the board, millimetres; below 0: the board's own black or white.
  std::function<double(const Eigen::Vector2d&)> cover = [](const auto&) { return -1.0; };
  /// Light along a ray of the camera, board frame in millimetres, in front of the board; below 0:
  /// none there.
  std::function<double(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray)> in_front =
      [](const auto&, const auto&) { return -1.0; };
  double white = 0.8, black = 0.04, surroundings = 0.1;
  double vignetting = 0;  ///< loss in the corners
  double blur_px = 0.4;   ///< of the lens, standard deviation
  double noise = 0;       ///< standard deviation, of white light
  int samples = 4;        ///< a pixel, along a side
  std::uint64_t seed = 1;
};

[[nodiscard]] MergedPicture render(const BoardScene& scene);

/// A camera `distance_mm` from a place of the board, in the direction (theta, phi) of the local
/// frame, turned about its axis by `roll`; it looks at the place.
[[nodiscard]] RigidTransform camera_at(const Eigen::Vector2d& place_mm,
                                       double distance_mm,
                                       double theta_rad,
                                       double phi_rad,
                                       double roll_rad);
/// Local frame to board frame; the other way too.
[[nodiscard]] inline Eigen::Vector3d flip_local(const Eigen::Vector3d& direction) {
  return {direction.x(), -direction.y(), -direction.z()};
}

/// For looking at: an 8-bit PNG in the folder that the environment variable VENEER_TEST_PICTURES
/// names, if it does.
void show(const MergedPicture& picture, const std::string& name);

}  // namespace veneer::capture::testing
