// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibration/wizard/step.h"

namespace veneer::calibration {

/// Places the projector in the tracker's world by all that ties it there so far: the board's views
/// and the cross-hairs that were touched. Needs WizardResults::geometry and ::registration.
/// Errors: those of geometry::tie_registration.
[[nodiscard]] Status tie_to_tracker(StepContext& context);

}  // namespace veneer::calibration
