// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "calibration/radiometry.h"
#include "simulation/bench.h"
#include "simulation/bench/colorimeter.h"

namespace veneer::cli {

/// The profile of a virtual bench's projector, measured with its own colorimeter; the projector's
/// pose and lens are taken from the bench. Errors: those of calibration::measure_profile.
[[nodiscard]] Result<calibration::MeasuredProfile> measure_profile_on_bench(
    const simulation::Bench& bench,
    simulation::VirtualPatchDisplay& display,
    simulation::VirtualColorimeter& colorimeter,
    Progress& progress);

}  // namespace veneer::cli
