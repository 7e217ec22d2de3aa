// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "calibration/verification.h"
#include "cli/commands/commands.h"
#include "cli/report/verification.h"
#include "simulation/bench/colorimeter.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

/// Holds a profile against readings of patches that it was not made from.
Result<int> verify_patches(CommandLine& line,
                           const fs::path& bench_path,
                           const fs::path& profile_path) {
  constexpr int kPatches = 200;
  constexpr std::uint64_t kSeed = 2;
  VENEER_ASSIGN(const std::unique_ptr<simulation::Bench> bench,
                simulation::Bench::load(bench_path));
  VENEER_ASSIGN(const calibration::ProjectorProfile profile,
                calibration::ProjectorProfile::load(profile_path));
  simulation::VirtualPatchDisplay display(*bench);
  simulation::VirtualColorimeter colorimeter(*bench, display, {});
  VENEER_ASSIGN(
      const calibration::ProfileVerification result,
      calibration::verify_profile(colorimeter,
                                  display,
                                  profile,
                                  calibration::verification_patches(profile, kPatches, kSeed),
                                  line.progress()));
  line.print({{"patches", kPatches},
              {"de00_mean", result.de00_mean},
              {"de00_p95", result.de00_p95},
              {"de00_max", result.de00_max}},
             fmt::format("{} patches: dE00 {:.2f} mean, {:.2f} at 95 %, {:.2f} max",
                         kPatches,
                         result.de00_mean,
                         result.de00_p95,
                         result.de00_max));
  return kExitDone;
}

}  // namespace

Result<int> run_verify(CommandLine& line) {
  VerificationOptions options;
  fs::path profile;
  CLI::App& app = line.app();
  app.add_option("--bench", options.bench, "The virtual bench, bench.toml")->required();
  auto* profile_option =
      app.add_option("--profile", profile, "A profile to hold against readings of the bench");
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
  if (!profile.empty()) return verify_patches(line, options.bench, profile);
  if (options.run.empty() || (options.set.empty() && options.material.empty())) {
    return fail(Errc::kInvalidOption,
                "say what to verify: --profile PROFILE, or --run FOLDER with --set SET or "
                "--material MATERIAL");
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
