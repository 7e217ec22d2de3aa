// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <functional>
#include <vector>

#include "base/image.h"
#include "base/rigid_transform.h"
#include "calibration/maps/fall_off.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// The samples of one pose: of every `step`-th pixel of the camera's pictures along both sides that
/// was decoded. The point is where the ray of the decoded pixel meets the board, so no lens of the
/// camera is asked for.
/// @param lit, unlit  the camera's pictures under the code and under black; the channels are
/// summed.
/// @param projector  of the pictures' size: projector pixels, NaN where not decoded (checked).
/// @param projector_from_board  the board is z = 0.
/// @param is_white  whether a point of the board (x, y, metres) is of its white, with a rim left
///                  out; empty: all of it.
/// @param step  1 or more (checked).
[[nodiscard]] std::vector<FallOffSample> board_samples(
    ImageView<const Rgb16> lit,
    ImageView<const Rgb16> unlit,
    ImageView<const Eigen::Vector2f> projector,
    const ProjectorGeometry& geometry,
    const RigidTransform& projector_from_board,
    const std::function<bool(const Eigen::Vector2d& point)>& is_white,
    int channel,
    int step,
    int pose);

}  // namespace veneer::calibration
