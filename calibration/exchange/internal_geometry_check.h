// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "base/result.h"
#include "calibration/profile.h"

namespace veneer::calibration {

/// That files for others can be made of it. Errors: kBadFormat.
[[nodiscard]] inline Status check_pinhole(const ProjectorGeometry& g) {
  constexpr double kUnitTolerance = 1e-6;  // as a profile on disk may have it
  const RigidTransform& pose = g.world_from_projector;
  if (g.width <= 0 || g.height <= 0)
    return fail(Errc::kBadFormat, "the raster is {} x {} pixels", g.width, g.height);
  if (!(g.fx > 0 && g.fy > 0) || !std::isfinite(g.fx) || !std::isfinite(g.fy) ||
      !std::isfinite(g.cx) || !std::isfinite(g.cy))
    return fail(Errc::kBadFormat,
                "the pinhole {}, {}, {}, {} is not finite or its focal length not above 0",
                g.fx,
                g.fy,
                g.cx,
                g.cy);
  if (!pose.translation.allFinite() || !(std::abs(pose.rotation.norm() - 1) <= kUnitTolerance))
    return fail(Errc::kBadFormat, "the pose is not finite or its rotation not of unit length");
  return {};
}

}  // namespace veneer::calibration
