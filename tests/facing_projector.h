// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include <cmath>

#include "calibration/profile.h"

namespace veneer {

/// The profile of a small ideal projector 1 m in front of the object, looking at it: linear in 8
/// bits, sRGB-like primaries, a field of view of 44 x 33 degrees.
inline calibration::ProjectorProfile facing_projector(int width, int height) {
  calibration::ProjectorProfile profile;
  auto& g = profile.geometry;
  g.width = width;
  g.height = height;
  g.fx = g.fy = 1.25 * width;
  g.cx = 0.5 * width;
  g.cy = 0.5 * height;
  g.world_from_projector.translation = {0, 0, 1};
  g.world_from_projector.rotation = Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  for (auto& curve : profile.tone_curves)
    for (int code = 0; code < 256; ++code) curve.push_back(code / 255.0);
  profile.primaries << 82, 71, 36, 42, 143, 14, 4, 24, 190;
  profile.vignetting = Image<float>(1, 1, 1.0F);
  return profile;
}

}  // namespace veneer
