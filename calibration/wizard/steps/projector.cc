// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <optional>
#include <utility>

#include "calibration/wizard/steps/internal_projector.h"
#include "projector/control_watch.h"

namespace veneer::calibration {
namespace {

using projector::ControlRecord;
using projector::Power;
using projector::ProjectorState;

// Not the name of a step: to do a step again may not make another state the one of the session,
// whose readings stay.
constexpr const char* kJournal = "projector's state";
constexpr const char* kState = "at the beginning";
constexpr const char* kChanged = "was changed";

/// The state that the session's readings were begun in; nothing where none was read yet.
std::optional<ControlRecord> first_state(const Journal& journal) {
  const nlohmann::json* found = journal.find(kJournal, kState);
  if (found == nullptr || !found->is_object()) return std::nullopt;
  ControlRecord record;
  for (const auto& [key, value] : found->items())
    if (value.is_string()) record[key] = value.get<std::string>();
  return record;
}

std::string joined(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& each : sentences) text += (text.empty() ? "" : "; ") + each;
  return text;
}

/// That with which there is nothing to be measured.
std::vector<Finding> obstacles_in(const ProjectorState& state) {
  std::vector<Finding> found;
  const auto add = [&](std::string what, std::string remedy) {
    found.push_back({Finding::Severity::kFailure, std::move(what), std::move(remedy)});
  };
  if (state.power != Power::kOn && state.power != Power::kUnknown)
    add(fmt::format("the projector is {}, not on", name_of(state.power)),
        state.power == Power::kWarmUp
            ? "wait until its picture is there, then do this step again"
            : "switch it on (veneer projector on), wait until its picture is there, then do this "
              "step again");
  if (state.muted == true)
    add("the projector blanks its picture",
        "unblank it (veneer projector unblank), then do this step again");
  if (state.frozen == true)
    add("the projector's picture is frozen: what is shown does not reach the object",
        "unfreeze it (veneer projector unfreeze), then do this step again");
  return found;
}

/// What else would spoil colours.
std::vector<std::string> doubts_about(ProjectorState state) {
  state.power = Power::kOn;
  state.muted = false;
  state.frozen = false;
  return projector::warnings(state);
}

}  // namespace

Result<Answer> look_at_projector(StepContext& context) {
  VENEER_ASSIGN(const ProjectorState state, context.devices.control->read_state());
  context.results.projector_record = to_record(state);
  const ControlRecord& now = context.results.projector_record;
  context.report.summary =
      fmt::format("{}: {}", context.devices.control->description(), summary_of(state));
  std::vector<Finding> obstacles = obstacles_in(state);
  if (!obstacles.empty()) {
    for (Finding& each : obstacles) context.find(std::move(each));
    return Answer::kDone;
  }
  if (const auto first = first_state(context.journal)) {
    if (const auto changes = projector::differences(*first, now); !changes.empty()) {
      context.find({Finding::Severity::kFailure,
                    fmt::format("the projector is not as it was when this session was begun: {}",
                                joined(changes)),
                    "set it back, then do this step again; or begin anew with --restart"});
      return Answer::kDone;
    }
  } else {
    VENEER_TRY(context.journal.add(kJournal, kState, now));
  }
  const std::vector<std::string> doubts = doubts_about(state);
  for (const std::string& each : doubts)
    context.find({Finding::Severity::kWarning, "the projector: " + each, ""});
  if (doubts.empty()) return Answer::kDone;
  return context.please(Task::kSeeToProjector,
                        0,
                        fmt::format("This may spoil the colours: {}. See to it and do this step "
                                    "again (a), or go on as it is.",
                                    joined(doubts)));
}

Status look_at_projector_again(StepContext& context) {
  const auto first = first_state(context.journal);
  const bool left_out = std::ranges::any_of(context.reports, [](const StepReport& report) {
    return report.name == "projector" && report.skipped;
  });
  if (left_out || !first) {
    context.results.projector_record.clear();
    return {};
  }
  VENEER_ASSIGN(const ProjectorState state, context.devices.control->read_state());
  context.results.projector_record = to_record(state);
  const auto changes = projector::differences(*first, context.results.projector_record);
  const nlohmann::json* changed_before = context.journal.find(kJournal, kChanged);
  if (!changes.empty()) {
    if (changed_before == nullptr)
      VENEER_TRY(context.journal.add(kJournal, kChanged, joined(changes)));
    return fail(Errc::kBadFormat,
                "the projector was changed while it was calibrated, so that the readings do not "
                "fit together: {}. No profile was written; set it back and do this step again, or "
                "begin anew with --restart",
                joined(changes));
  }
  if (changed_before != nullptr && changed_before->is_string())
    context.find({Finding::Severity::kWarning,
                  fmt::format("the projector was changed while it was calibrated, and set back: {}",
                              changed_before->get<std::string>()),
                  "begin anew with --restart if the proof is not good"});
  return {};
}

}  // namespace veneer::calibration
