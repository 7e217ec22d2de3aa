// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace veneer::capture {

/// OpenCV's first pixel centre is (0, 0), ours (0.5, 0.5).
inline constexpr double kPixelCentre = 0.5;

[[nodiscard]] inline cv::Point2f to_opencv(const Eigen::Vector2d& pixel) {
  return {static_cast<float>(pixel.x() - kPixelCentre),
          static_cast<float>(pixel.y() - kPixelCentre)};
}
template <class Point>
[[nodiscard]] Eigen::Vector2d from_opencv(const Point& pixel) {
  return {pixel.x + kPixelCentre, pixel.y + kPixelCentre};
}

}  // namespace veneer::capture
