// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>

#include "base/result.h"
#include "capture/plan.h"

namespace veneer::capture {

/// Where a point of the camera's frame is in the picture; nothing at or behind the camera, or where
/// the lens's polynomial no longer rises with the radius (there it would fold back).
[[nodiscard]] std::optional<Eigen::Vector2d> project(const CameraLens& lens,
                                                     const Eigen::Vector3d& in_camera);
/// The ray through a pixel, camera frame, unit; nothing where no ray falls there.
[[nodiscard]] std::optional<Eigen::Vector3d> ray_through(const CameraLens& lens,
                                                         const Eigen::Vector2d& pixel);
/// Errors: kInvalidOption (focal lengths not above 0, anything not finite).
[[nodiscard]] Status check_lens(const CameraLens& lens);

}  // namespace veneer::capture
