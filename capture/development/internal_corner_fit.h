// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <optional>

#include "capture/development/internal_board_layout.h"

namespace veneer::capture {

/// Where a corner is, by laying the board's drawing over the picture around it.
struct CornerFit {
  Eigen::Vector2d pixel{0, 0};  ///< first centre (0.5, 0.5)
  double likeness = 0;          ///< correlation of drawing and picture
};
/// @param grey  linear light, CV_32F.   @param pixel_from_mm  homography, good to a pixel or two.
/// Nothing where the corner is too near to the picture's rim or leads away from where it began.
[[nodiscard]] std::optional<CornerFit> fit_corner(const cv::Mat& grey,
                                                  const BoardLayout& layout,
                                                  const Eigen::Matrix3d& pixel_from_mm,
                                                  const Eigen::Vector2d& corner_mm,
                                                  double reach_mm);

}  // namespace veneer::capture
