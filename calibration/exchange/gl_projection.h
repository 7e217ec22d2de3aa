// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <string>

#include "base/result.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// Which way the eye's axes point in a GL program.
enum class EyeAxes {
  kVeneer,  ///< +z forward, y down, as everywhere here
  kOpenGl,  ///< -z forward, y up, as GL's own tradition has it
};

/// The matrix P that takes a point of the projector's frame to GL's clip space, so that with a
/// viewport of the raster's size it lands on the pixel that the pinhole says: window x is our x,
/// window y, which GL counts from below, is height - y; first pixel centre (0.5, 0.5) in both.
/// Depth near_m lands on -1, far_m on 1. Point as a column: P (x, y, z, 1).
/// Errors: kBadFormat (the geometry), kInvalidOption (not 0 < near_m < far_m < infinity).
[[nodiscard]] Result<Eigen::Matrix4d> gl_projection(const ProjectorGeometry& geometry,
                                                    double near_m,
                                                    double far_m,
                                                    EyeAxes axes = EyeAxes::kOpenGl);

/// As JSON for other programs: "projection" (column-major, as glUniformMatrix4fv and glLoadMatrix
/// take it), "view" (world into the eye, the same axes), "width", "height", "near_m", "far_m",
/// "eye_axes". Errors: as above.
[[nodiscard]] Result<std::string> gl_projection_json(const ProjectorGeometry& geometry,
                                                     double near_m,
                                                     double far_m,
                                                     EyeAxes axes = EyeAxes::kOpenGl);
/// Errors: as above, and kIo.
[[nodiscard]] Status write_gl_projection(const std::filesystem::path& path,
                                         const ProjectorGeometry& geometry,
                                         double near_m,
                                         double far_m,
                                         EyeAxes axes = EyeAxes::kOpenGl);

}  // namespace veneer::calibration
