// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "calibration/wizard/step.h"

namespace veneer::calibration {

/// Every step, in order.
[[nodiscard]] std::span<const Step> wizard_steps();

/// How a calibration ended.
struct WizardOutcome {
  bool finished = false;  ///< false: the person stopped; the session can be resumed
  WizardResults results;
  std::vector<StepReport> reports;  ///< of the steps that were run
  int readings_taken = 0;
  int readings_recalled = 0;  ///< that an earlier run of the session had taken
};

/// Leads a person through a calibration and writes the profile. Each finding is on the disk before
/// the next one is looked for: after a kill, a power loss or a full disk the same call goes on
/// where it was, and the profile that was there before stays until the new one is complete. Errors:
/// kInvalidOption (options, a session begun under other conditions), and what a step returned where
/// the operator chose to stop.
[[nodiscard]] Result<WizardOutcome> run_wizard(const WizardOptions& options,
                                               Devices& devices,
                                               Progress& progress);

/// What makes a session the same: used by Journal.
[[nodiscard]] nlohmann::json identity_of(const WizardOptions& options, const Devices& devices);

}  // namespace veneer::calibration
