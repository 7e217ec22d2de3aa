// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/result.h"
#include "base/rigid_transform.h"
#include "calibration/profile.h"
#include "simulation/bench.h"

namespace veneer::simulation {

/// How far off the picture lands, in projector pixels.
struct RegistrationError {
  std::int64_t points = 0;
  double p50_px = 0;
  double p95_px = 0;
  double max_px = 0;
};

/// Where the hidden truth and where a profile say that points of the object lie on the raster. The
/// points are those that the projector lights through every `step`-th pixel along both sides.
/// @param world_from_object  the same for both.
/// Errors: kInvalidOption (a step below 1; the projector lights nothing of the object; a profile
/// for which a lit point lies behind the lens).
[[nodiscard]] Result<RegistrationError> registration_error(
    const Bench& bench,
    const calibration::ProjectorGeometry& geometry,
    const RigidTransform& world_from_object = {},
    int step = 8);

}  // namespace veneer::simulation
