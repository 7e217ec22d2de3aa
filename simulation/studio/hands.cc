// SPDX-License-Identifier: Apache-2.0
#include "simulation/studio/hands.h"

namespace veneer::simulation::studio {

namespace {

Status check_index(std::string_view name, int index, int count) {
  if (index >= 0 && index < count) return {};
  return fail(Errc::kInvalidOption,
              "arranging the studio: there is no {} {}; the plan has 0 to {}",
              name,
              index,
              count - 1);
}

}  // namespace

Status StudioHands::please(const capture::HandRequest& request) {
  using Task = capture::HandRequest::Task;
  Arrangement arrangement = rig_.arrangement();
  double seconds = kMove_s;
  switch (request.task) {
    case Task::kPlaceTarget:
      if (request.target == capture::Target::kMirror && !rig_.has_mirror())
        return fail(Errc::kUnavailable,
                    "placing the studio's mirror: the plan says at no light how it stands; give it "
                    "[mirror] light, or ask for none");
      arrangement.target = request.target;
      break;
    case Task::kPlaceView:
      VENEER_TRY(check_index("view", request.index, rig_.views()));
      arrangement.view = request.index;
      break;
    case Task::kPlaceLight:
      VENEER_TRY(check_index("light", request.index, rig_.lights()));
      arrangement.light = request.index;
      break;
    case Task::kDarken:
    case Task::kLight:
      arrangement.dark = request.task == Task::kDarken;
      seconds = kSwitch_s;
      break;
    case Task::kTurnAnalyser:
      return rig_.turn_analyser(request.angle_rad, kMove_s);
  }
  rig_.pass(seconds);
  rig_.arrange(arrangement);
  return {};
}

}  // namespace veneer::simulation::studio
