// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/wizard.h"

#include <algorithm>
#include <array>

#include "base/journal.h"

namespace veneer::calibration {
namespace {

constexpr JournalKind kJournalKind{
    .format = "veneer-calibration-session",
    .doing = "opening the session",
    .busy =
        "another program is calibrating in it; let that one finish, or name another session "
        "with --session",
    .restart = "begin again with --restart"};

constexpr std::array kSteps{
    Step{"projector",
         "Projector",
         "Asks the projector how it is set, so that the profile says so and a change can be told "
         "later.",
         &look_at_projector},
    Step{"picture",
         "Picture",
         "Shows black, white and greys to see whether they reach the instrument and whether "
         "anything between code and lamp bends or cuts them.",
         &check_picture},
    Step{"warm-up",
         "Warm-up",
         "Shows white and watches until the lamp has settled; what is measured before that holds "
         "for a few minutes only.",
         &warm_up},
    Step{"room",
         "Room",
         "Reads the room's light with the lens covered, and how much the instrument's readings "
         "scatter.",
         &look_at_room},
    Step{"geometry",
         "Geometry",
         "Projects stripes onto a chequered board in several poses: where the projector stands, "
         "how it is aimed and how its lens draws.",
         &find_geometry},
    Step{"object",
         "Object",
         "Touches known points of the object, and cross-hairs that the projector shows on it, with "
         "the tracked stylus: where the object stands, and that the picture lands on it.",
         &register_object},
    Step{"light",
         "Light and colour",
         "Reads ramps and mixtures of the channels, decides which colour model fits, and reads the "
         "fall-off over the picture and the object's surface.",
         &measure_light},
    Step{"verify",
         "Proof",
         "Reads patches that nothing was fitted to and compares them with what the profile "
         "expects.",
         &verify},
    Step{"publish",
         "Profile",
         "Writes the profile, what other programs read of it, and the report; the profile before "
         "it goes to the history.",
         &publish},
};

std::string text_of(const Finding& finding) {
  const char* mark = finding.severity == Finding::Severity::kNote      ? "note"
                     : finding.severity == Finding::Severity::kWarning ? "warning"
                                                                       : "problem";
  return fmt::format(
      "  {}: {}{}{}", mark, finding.what, finding.remedy.empty() ? "" : "; ", finding.remedy);
}

/// The first failure among a step's findings, as an error.
Status failure_in(const StepReport& report) {
  for (const Finding& finding : report.findings) {
    if (finding.severity == Finding::Severity::kFailure)
      return fail(Errc::kBadFormat, "{}; {}", finding.what, finding.remedy);
  }
  return {};
}

/// Whether a step was left out the last time: by the user, or since what it needs is not there.
bool was_left_out(const WizardOptions& options,
                  const std::vector<StepReport>& reports,
                  std::string_view name) {
  return options.skip.contains(std::string(name)) ||
         std::ranges::any_of(reports, [name](const StepReport& report) {
           return report.name == name && report.skipped;
         });
}

}  // namespace

std::span<const Step> wizard_steps() { return kSteps; }

Status WizardOptions::check() const {
  const auto wrong = [](std::string_view name, auto value, std::string_view range) {
    return fail(Errc::kInvalidOption, "calibrating: {} is {}; it must be {}", name, value, range);
  };
  if (profile.empty()) return fail(Errc::kInvalidOption, "calibrating: name the profile to write");
  if (session.empty()) return fail(Errc::kInvalidOption, "calibrating: name the session's folder");
  for (const std::string& name : skip) {
    if (std::ranges::find(kSteps, name, &Step::name) == kSteps.end()) {
      std::string known;
      for (const Step& step : kSteps) known += fmt::format(" {}", step.name);
      return fail(Errc::kInvalidOption,
                  "calibrating: there is no step \"{}\" to skip; the steps are{}",
                  name,
                  known);
    }
  }
  std::set<std::string> names;
  for (const Landmark& landmark : landmarks) {
    if (!names.insert(landmark.name).second)
      return fail(Errc::kInvalidOption,
                  "calibrating: two landmarks are called \"{}\"; give each a name of its own",
                  landmark.name);
  }
  VENEER_TRY(radiometry.check());
  if (!known_geometry && !skip.contains("geometry")) VENEER_TRY(board.check());
  if (board_poses < 4 || board_poses > 40)
    return wrong("the number of board poses", board_poses, "4 to 40");
  if (!(settled_per_minute > 0)) return wrong("settled_per_minute", settled_per_minute, "above 0");
  if (!(warm_up_interval_s > 0)) return wrong("warm_up_interval_s", warm_up_interval_s, "above 0");
  if (!(warm_up_window_s >= 4 * warm_up_interval_s))
    return wrong("warm_up_window_s", warm_up_window_s, "at least four intervals");
  if (!(frame_s > 0)) return wrong("frame_s", frame_s, "above 0");
  if (cross_hairs < 0 || cross_hairs > 20) return wrong("cross_hairs", cross_hairs, "0 to 20");
  if (verification_patches < 43 || verification_patches > 1000)
    return wrong("the number of verification patches", verification_patches, "43 to 1000");
  if (verification_repeats < 1 || verification_repeats > 100)
    return wrong("the number of verification repeats", verification_repeats, "1 to 100");
  return {};
}

nlohmann::json identity_of(const WizardOptions& options, const Devices& devices) {
  return {{"projector", devices.projector},
          {"instrument", devices.instrument},
          {"raster", {devices.width, devices.height, devices.bits}},
          {"board", {options.board.columns, options.board.rows, options.board.square}},
          {"reference_distance_m", options.radiometry.reference_distance_m},
          {"ramp_levels", options.radiometry.levels}};
}

Result<WizardOutcome> run_wizard(const WizardOptions& options,
                                 Devices& devices,
                                 Progress& progress) {
  VENEER_TRY(options.check());
  VENEER_CHECK(devices.display != nullptr && devices.colorimeter != nullptr &&
               devices.hands != nullptr && devices.clock != nullptr);
  if (devices.camera == nullptr && !options.known_geometry && !options.skip.contains("light"))
    return fail(
        Errc::kInvalidOption,
        "calibrating: there is no camera; take the geometry of an earlier profile over with "
        "--geometry");
  VENEER_ASSIGN(
      Journal journal,
      Journal::open(kJournalKind, options.session, identity_of(options, devices), options.restart));
  RecordedDevices recorded(*devices.display, *devices.colorimeter, journal);
  if (journal.resumed())
    devices.hands->say(fmt::format("Going on with the session {}: {} findings are there already.",
                                   options.session.string(),
                                   journal.size()));
  WizardOutcome outcome;
  std::size_t step = 0;
  std::string failed_before;  // what the last try of this step ended with
  while (step < kSteps.size()) {
    const Step& current = kSteps[step];
    const std::string name(current.name);
    StepReport report{name, std::string(current.title), false, {}, {}};
    const bool nobody_to_ask = current.run == &look_at_projector && devices.control == nullptr;
    if (nobody_to_ask || options.skip.contains(name)) {
      report.skipped = true;
      report.summary = nobody_to_ask ? "left out: no control of the projector is configured"
                                     : "left out, as asked";
      outcome.reports.push_back(std::move(report));
      ++step;
      continue;
    }
    devices.hands->say(
        fmt::format("\n[{}/{}] {}. {}", step + 1, kSteps.size(), current.title, current.about));
    recorded.begin(name);
    if (devices.begin_step) devices.begin_step();
    StepContext context{
        options, devices, journal, recorded, progress, outcome.results, report, outcome.reports};
    Result<Answer> answer = current.run(context);
    for (const Finding& finding : report.findings) devices.hands->say(text_of(finding));
    if (answer && *answer == Answer::kDone) {
      if (const Status found = failure_in(report); !found) answer = tl::unexpected(found.error());
    }
    if (!answer) {
      const Error why{answer.error().code,
                      fmt::format("{}: {}", current.title, answer.error().what)};
      if (devices.begin_step) devices.begin_step();
      // Tried again, a step recalls what it had found, so that an unplugged instrument costs
      // nothing. Where it then fails just as before, what it recalls is what is wrong.
      if (failed_before == why.what) {
        failed_before.clear();
        VENEER_TRY(journal.forget(name));
        continue;
      }
      VENEER_ASSIGN(answer, devices.hands->after_failure(name, why));
      if (*answer == Answer::kQuit) return tl::unexpected(why);
      if (*answer == Answer::kAgain) {
        failed_before = why.what;
        continue;
      }
    }
    failed_before.clear();
    switch (*answer) {
      case Answer::kDone:
        if (!report.summary.empty()) devices.hands->say("  " + report.summary);
        outcome.reports.push_back(std::move(report));
        ++step;
        break;
      case Answer::kSkip:
        report.skipped = true;
        if (report.summary.empty()) report.summary = "left out";
        outcome.reports.push_back(std::move(report));
        ++step;
        break;
      case Answer::kAgain:
        VENEER_TRY(journal.forget(name));
        break;
      case Answer::kBack: {
        // Readings of other steps stay: they are what was measured, whatever is made of them.
        std::size_t before = step;
        while (before > 0) {
          --before;
          if (!was_left_out(options, outcome.reports, kSteps[before].name)) break;
        }
        if (before == step || was_left_out(options, outcome.reports, kSteps[before].name)) {
          devices.hands->say("  There is no step before this one.");
          break;
        }
        step = before;
        VENEER_TRY(journal.forget(std::string(kSteps[step].name)));
        std::erase_if(outcome.reports, [&](const StepReport& each) {
          return std::ranges::any_of(std::span(kSteps).subspan(step),
                                     [&](const Step& later) { return later.name == each.name; });
        });
        break;
      }
      case Answer::kQuit:
        outcome.readings_taken = recorded.taken();
        outcome.readings_recalled = recorded.recalled();
        return outcome;
    }
  }
  // Without a profile on the disk the session is all that there is.
  outcome.finished = !was_left_out(options, outcome.reports, kSteps.back().name);
  outcome.readings_taken = recorded.taken();
  outcome.readings_recalled = recorded.recalled();
  return outcome;
}

}  // namespace veneer::calibration
