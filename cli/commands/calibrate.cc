// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <memory>
#include <system_error>

#include "base/exit_code.h"
#include "calibration/profile_store.h"
#include "calibration/wizard/report.h"
#include "calibration/wizard/wizard.h"
#include "cli/calibrate/bench_devices.h"
#include "cli/calibrate/operators.h"
#include "cli/calibrate/rig_devices.h"
#include "cli/commands/calibrate_colour.h"
#include "cli/commands/calibrate_geometry.h"
#include "cli/commands/commands.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

struct CalibrateOptions {
  fs::path bench;
  fs::path rig;
  fs::path geometry;  // an earlier profile
  bool yes = false;
  std::vector<std::string> skip;
  calibration::WizardOptions wizard;
};

void declare(CLI::App& app, CalibrateOptions& options) {
  std::string steps;
  for (const calibration::Step& step : calibration::wizard_steps())
    steps += fmt::format("{}{}", steps.empty() ? "" : ", ", step.name);
  auto* bench = app.add_option("--bench", options.bench, "A virtual bench, bench.toml");
  app.add_option("--rig", options.rig, "Real devices, rig.toml; see docs/howto/calibrate.md")
      ->excludes(bench);
  app.add_option("-o,--output", options.wizard.profile, "The profile to write, a folder")
      ->required();
  app.add_flag("--yes", options.yes, "Ask nothing: what hands have to do counts as done");
  app.add_option(
      "--session",
      options.wizard.session,
      "Where findings are kept until the profile is written (default: the profile's name "
      "and \".session\")");
  app.add_flag(
      "--restart", options.wizard.restart, "Forget what an earlier run of the session found");
  app.add_option("--skip", options.skip, "Leave a step out: " + steps);
  app.add_option("--geometry",
                 options.geometry,
                 "A profile whose geometry is taken over where none is measured");
  app.add_option("--board-poses", options.wizard.board_poses, "Poses of the chequered board")
      ->capture_default_str();
  app.add_option("--patches",
                 options.wizard.verification_patches,
                 "Patches of the proof, none of which is fitted")
      ->capture_default_str();
  app.add_option("--repeats",
                 options.wizard.verification_repeats,
                 "Readings of each of them that are averaged")
      ->capture_default_str();
}

Status prepare(CalibrateOptions& options) {
  calibration::WizardOptions& wizard = options.wizard;
  wizard.skip = {options.skip.begin(), options.skip.end()};
  if (wizard.session.empty()) {
    wizard.session = wizard.profile.lexically_normal();
    if (!wizard.session.has_filename()) wizard.session = wizard.session.parent_path();
    wizard.session += ".session";
  }
  if (!options.geometry.empty()) {
    VENEER_ASSIGN(const calibration::ProjectorProfile earlier,
                  calibration::ProjectorProfile::load(options.geometry));
    wizard.known_geometry = earlier.geometry;
  }
  return {};
}

/// What a machine wants to know of the outcome.
nlohmann::ordered_json summary_of(const calibration::WizardOutcome& outcome,
                                  const CalibrateOptions& options) {
  nlohmann::ordered_json json{{"profile", options.wizard.profile.string()},
                              {"finished", outcome.finished},
                              {"readings", outcome.readings_taken},
                              {"readings_recalled", outcome.readings_recalled}};
  const calibration::WizardResults& results = outcome.results;
  if (results.geometry) {
    json["projector_rms_px"] = results.geometry->projector_rms_px;
    json["held_out_px"] = results.geometry->held_out_projector_rms_px;
  }
  if (results.measured) {
    json["model"] = results.measured->profile.colour_model;
    json["fitted_patches"] = results.measured->fitted_patches;
    json["additivity_error"] = results.measured->additivity_error;
    json["additive"] = results.measured->additivity.additive;
  }
  if (results.verification) {
    const calibration::Verdict verdict = calibration::judge(*results.verification);
    json["de00_mean"] = results.verification->de00_mean;
    json["de00_p95"] = results.verification->de00_p95;
    json["de00_max"] = results.verification->de00_max;
    json["good"] = verdict.good;
    json["verdict"] = verdict.sentence;
  }
  json["warnings"] = nlohmann::ordered_json::array();
  for (const calibration::StepReport& step : outcome.reports) {
    for (const calibration::Finding& finding : step.findings) {
      if (finding.severity != calibration::Finding::Severity::kNote)
        json["warnings"].push_back(step.name + ": " + finding.what);
    }
  }
  return json;
}

}  // namespace

Result<int> run_calibrate(CommandLine& line) {
  if (line.starts_with("geometry", "Measure only the geometry, from pictures on disk"))
    return calibrate_geometry(line);
  if (line.starts_with("colour", "Fit only colour models, to readings in a .ti3"))
    return calibrate_colour(line);
  CalibrateOptions options;
  declare(line.app(), options);
  line.parse();
  if (options.bench.empty() && options.rig.empty())
    return fail(Errc::kInvalidOption,
                "say what to calibrate: --bench BENCH.toml for a virtual bench, --rig RIG.toml for "
                "real devices");
  VENEER_TRY(prepare(options));

  std::unique_ptr<calibration::Operator> talker;
  if (options.yes) {
    talker = std::make_unique<AutomaticOperator>(line.quiet());
  } else {
    talker = std::make_unique<TerminalOperator>();
  }
  std::unique_ptr<BenchDevices> bench;
  std::unique_ptr<RigDevices> rig;
  calibration::Devices devices;
  if (!options.bench.empty()) {
    VENEER_ASSIGN(bench, BenchDevices::open(options.bench, *talker));
    bench->fill(options.wizard);
    devices = bench->devices();
  } else {
    VENEER_ASSIGN(rig, RigDevices::open(options.rig, *talker, options.wizard));
    devices = rig->devices();
  }
  const Result<calibration::WizardOutcome> outcome =
      calibration::run_wizard(options.wizard, devices, line.progress());
  if (!outcome)
    return fail(outcome.error().code,
                "{}; what was found is kept in {}: the same command goes on from there",
                outcome.error().what,
                options.wizard.session.string());
  if (!outcome->finished) {
    line.print(summary_of(*outcome, options),
               fmt::format("no profile was written; what was found is kept in {}: the same command "
                           "goes on from there",
                           options.wizard.session.string()));
    return kExitFailed;
  }
  // The next calibration begins anew; what this one read is in the profile's folder.
  std::error_code ignored;
  fs::remove(options.wizard.session / "journal.jsonl", ignored);
  fs::remove(options.wizard.session, ignored);  // if there is nothing of somebody else's in it
  const nlohmann::ordered_json summary = summary_of(*outcome, options);
  const bool good = summary.value("good", true);
  line.print(summary,
             fmt::format("{}\nwrote {}; look at {}",
                         summary.value("verdict", "Not proved: the step verify was left out."),
                         options.wizard.profile.string(),
                         (options.wizard.profile / "report.html").string()));
  return good ? kExitDone : kExitGateMissed;
}

}  // namespace veneer::cli
