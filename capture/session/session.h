// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/progress.h"
#include "base/result.h"
#include "capture/camera.h"
#include "capture/hands.h"
#include "capture/plan.h"
#include "capture/polariser.h"

namespace veneer::capture {

/// What a session works with; all borrowed.
struct CaptureDevices {
  Camera* camera = nullptr;
  Polariser* polariser = nullptr;  ///< null where the sensor has its analysers on it
  Hands* hands = nullptr;
  Clock* clock = nullptr;
};

struct SessionOutcome {
  int taken = 0;     ///< pictures, this time
  int recalled = 0;  ///< that an earlier run had taken
  std::vector<std::string>
      warnings;  ///< saturation, movement, too little light; each with its place
};

/// Takes what the plan asks for and is not there yet: for each target (white, mirror, ball,
/// sample), view and light a bracket of exposures chosen from the histogram, once behind each angle
/// of the analyser, and the same without the projector's light. Mirror and ball are taken from view
/// 0 alone, the mirror at the plan's one light. Lights go forth and back, so that as little as
/// possible is moved; the analyser comes back to where it was at the beginning of a direction, so
/// that its last picture can repeat the first: what moved, or a light that changed by more than
/// 1 %, is a warning and noted ("movement sample 0 12": moved, movement, light, see Change).
/// Progress says how long the rest will take. Errors: those of Recording::resume(), of the devices
/// (the session goes on from there when it is run again), kInvalidOption (a plan without lights, or
/// one that asks for a polariser where there is none), kIo.
[[nodiscard]] Result<SessionOutcome> run_session(const CapturePlan& plan,
                                                 const std::filesystem::path& folder,
                                                 const CaptureDevices& devices,
                                                 Progress& progress);

}  // namespace veneer::capture
