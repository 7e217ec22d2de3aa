// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "calibration/wizard/step.h"

namespace veneer::calibration {

/// Whether the projector is still as it was when the session was begun, before a profile is
/// written; takes its state into the results, or takes it out where the step was left out.
/// Errors: kBadFormat (it was changed: the readings do not fit together), those of
/// ProjectorControl::read_state.
[[nodiscard]] Status look_at_projector_again(StepContext& context);

}  // namespace veneer::calibration
