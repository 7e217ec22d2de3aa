// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/exit_code.h"
#include "calibration/verification.h"
#include "cli/calibrate/bench_devices.h"
#include "cli/calibrate/operators.h"
#include "cli/calibrate/rig_devices.h"
#include "cli/commands/commands.h"
#include "cli/report/verification.h"
#include "projector/control_watch.h"
#include "simulation/bench/registration.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

struct PatchOptions {
  fs::path bench;
  fs::path rig;
  fs::path profile;
  int patches = 64;
  int repeats = 8;
};

struct Devices {
  std::unique_ptr<calibration::Operator> hands;
  std::unique_ptr<BenchDevices> bench;
  std::unique_ptr<RigDevices> rig;
  calibration::Devices devices;
};

Result<Devices> open_devices(CommandLine& line, const PatchOptions& options) {
  Devices opened;
  if (!options.bench.empty()) {
    opened.hands = std::make_unique<AutomaticOperator>(line.quiet());
    VENEER_ASSIGN(opened.bench, BenchDevices::open(options.bench, *opened.hands));
    opened.devices = opened.bench->devices();
    // A profile is held against a lamp that is warm.
    constexpr double kWarm_s = 3600;
    VENEER_TRY(opened.devices.display->show({}));
    opened.devices.clock->sleep_until(opened.devices.clock->now() + from_seconds(kWarm_s));
    return opened;
  }
  opened.hands = std::make_unique<TerminalOperator>();
  calibration::WizardOptions unused;
  VENEER_ASSIGN(opened.rig, RigDevices::open(options.rig, *opened.hands, unused));
  opened.devices = opened.rig->devices();
  return opened;
}

/// What became of the projector since the profile was measured, a line each.
std::vector<std::string> warnings_of(const projector::ControlReport& report) {
  std::vector<std::string> lines;
  if (!report.reachable)
    lines.push_back(fmt::format("the projector cannot be asked how it is set: {}", report.text));
  for (const std::string& each : report.changes)
    lines.push_back(fmt::format(
        "the projector is not as it was when the profile was measured: {}; set it back, or "
        "calibrate again",
        each));
  for (const std::string& each : report.warnings) lines.push_back("the projector: " + each);
  return lines;
}

/// Holds a profile against readings of patches that it was not made from.
Result<int> verify_patches(CommandLine& line, const PatchOptions& options) {
  constexpr std::uint64_t kSeed = 2;  // other patches than the wizard's own proof
  VENEER_ASSIGN(const calibration::ProjectorProfile profile,
                calibration::ProjectorProfile::load(options.profile));
  VENEER_ASSIGN(Devices opened, open_devices(line, options));
  const calibration::Devices& devices = opened.devices;
  if (devices.width != profile.geometry.width || devices.height != profile.geometry.height ||
      devices.bits != profile.bits)
    return fail(
        Errc::kInvalidOption,
        "verifying {}: it is for {} x {} pixels of {} bits, the projector has {} x {} of {}; "
        "set the mode that was calibrated, or calibrate again",
        options.profile.string(),
        profile.geometry.width,
        profile.geometry.height,
        profile.bits,
        devices.width,
        devices.height,
        devices.bits);
  // Before all else: where figures are bad, this is why.
  std::optional<projector::ControlReport> control;
  std::vector<std::string> warnings;
  if (devices.control != nullptr) {
    control = projector::look_at(*devices.control, profile.record);
    warnings = warnings_of(*control);
    for (const std::string& each : warnings) devices.hands->say("Warning: " + each);
  }
  VENEER_ASSIGN(
      const calibration::ProfileVerification result,
      calibration::verify_profile(
          *devices.colorimeter,
          *devices.display,
          profile,
          calibration::verification_patches(profile, options.patches, kSeed, devices.aims_itself),
          {options.repeats},
          line.progress()));
  const calibration::Verdict verdict = calibration::judge(result);
  nlohmann::ordered_json json{{"patches", options.patches},
                              {"de00_mean", result.de00_mean},
                              {"de00_p95", result.de00_p95},
                              {"de00_max", result.de00_max},
                              {"noise_de00_mean", result.noise_de00_mean},
                              {"relative_noise", result.relative_noise},
                              {"additivity_error", result.additivity_error},
                              {"gates", {verdict.gate_mean, verdict.gate_p95, verdict.gate_max}},
                              {"good", verdict.good},
                              {"calibrate_again", verdict.calibrate_again},
                              {"verdict", verdict.sentence}};
  std::string text;
  if (control) {
    json["projector"] = {{"reachable", control->reachable},
                         {"state", control->text},
                         {"changes", control->changes},
                         {"warnings", control->warnings}};
    for (const std::string& each : warnings) text += "Warning: " + each + "\n";
  }
  text += verdict.sentence;
  if (opened.bench) {
    // Only a bench knows where its pixels really land.
    VENEER_ASSIGN(const simulation::RegistrationError registration,
                  simulation::registration_error(opened.bench->bench(), profile.geometry));
    json["registration_p50_px"] = registration.p50_px;
    json["registration_p95_px"] = registration.p95_px;
    json["registration_max_px"] = registration.max_px;
    text += fmt::format("\nOn the object its pixels land {:.2f} px (95 %) from where they should.",
                        registration.p95_px);
  }
  line.print(json, text);
  return verdict.good ? kExitDone : kExitGateMissed;
}

}  // namespace

Result<int> run_verify(CommandLine& line) {
  VerificationOptions options;
  PatchOptions patches;
  CLI::App& app = line.app();
  auto* bench_option = app.add_option("--bench", options.bench, "The virtual bench, bench.toml");
  app.add_option("--rig", patches.rig, "Real devices, rig.toml, as \"veneer calibrate\" takes them")
      ->excludes(bench_option);
  auto* profile_option =
      app.add_option("--profile", patches.profile, "A profile to hold against readings of patches");
  app.add_option("--patches", patches.patches, "How many")
      ->capture_default_str()
      ->check(CLI::Range(1, 10000));
  app.add_option("--repeats", patches.repeats, "Readings of each that are averaged")
      ->capture_default_str()
      ->check(CLI::Range(1, 100));
  auto* run_option = app.add_option(
      "--run", options.run, "The folder of a run of veneerd, to be seen on the bench");
  auto* set_option =
      app.add_option("--set", options.set, "The sample set of its material")->needs(run_option);
  app.add_option("--material",
                 options.material,
                 "In place of the set: its fitted material, so that the error of the fit is left "
                 "out")
      ->needs(run_option)
      ->excludes(set_option);
  app.add_option("--every", options.every, "Look at every n-th recorded frame")
      ->capture_default_str();
  app.add_option("--pictures", options.pictures, "Folder for pictures of what is seen");
  run_option->excludes(profile_option);
  line.parse();
  if (options.bench.empty() && patches.rig.empty())
    return fail(Errc::kInvalidOption,
                "say where to look: --bench BENCH.toml, or --rig RIG.toml for real devices");
  if (!patches.profile.empty()) {
    patches.bench = options.bench;
    return verify_patches(line, patches);
  }
  if (options.run.empty() || options.bench.empty() ||
      (options.set.empty() && options.material.empty())) {
    return fail(
        Errc::kInvalidOption,
        "say what to verify: --profile PROFILE, or --bench BENCH.toml with --run FOLDER and "
        "--set SET or --material MATERIAL");
  }

  VENEER_ASSIGN(const RunVerification result, verify_run(options, line.progress()));
  line.print({{"frames", result.frames.size()},
              {"de00_mean", result.within_gamut.mean},
              {"de00_p95", result.within_gamut.p95},
              {"de00_max", result.within_gamut.max},
              {"in_gamut", result.in_gamut_fraction},
              {"de00_covered_mean", result.covered.mean},
              {"de00_covered_p95", result.covered.p95}},
             fmt::format("{} frames: dE00 {:.2f} mean, {:.2f} at 95 % in gamut ({:.1f} % of the "
                         "pixels); {:.2f} mean over all",
                         result.frames.size(),
                         result.within_gamut.mean,
                         result.within_gamut.p95,
                         100 * result.in_gamut_fraction,
                         result.covered.mean));
  return kExitDone;
}

}  // namespace veneer::cli
