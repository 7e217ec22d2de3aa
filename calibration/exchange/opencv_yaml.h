// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// The geometry as a file that cv::FileStorage reads: image_width, image_height, camera_matrix,
/// distortion_coefficients, and R and T, which take points of the world into the projector's frame
/// (metres). In OpenCV's convention, where the centre of the first pixel is (0, 0): cx and cy are
/// less than ours by one half.
/// @param distortion  k1, k2, p1, p2, k3, ... as OpenCV counts them: 0, 4, 5, 8, 12 or 14 of them,
///                    finite. None is written as five zeros.
/// Errors: kBadFormat (geometry that makes no pinhole; another number of coefficients).
[[nodiscard]] Result<std::string> opencv_yaml(const ProjectorGeometry& geometry,
                                              const std::vector<double>& distortion = {});
/// Errors: as above, and kIo.
[[nodiscard]] Status write_opencv_yaml(const std::filesystem::path& path,
                                       const ProjectorGeometry& geometry,
                                       const std::vector<double>& distortion = {});

}  // namespace veneer::calibration
