// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include "base/exit_code.h"
#include "calibration/verification.h"
#include "cli/bench_profile.h"
#include "cli/commands/calibrate_geometry.h"
#include "cli/commands/commands.h"

namespace veneer::cli {

Result<int> run_calibrate(CommandLine& line) {
  if (line.first_argument() == "geometry") return calibrate_geometry(line);
  std::filesystem::path bench_path;
  std::filesystem::path out;
  int patches = 64;
  CLI::App& app = line.app();
  app.add_option("--bench",
                 bench_path,
                 "A virtual bench, bench.toml: its projector and colorimeter are used")
      ->required();
  app.add_option("-o,--output", out, "The profile to write, a folder")->required();
  app.add_option("--patches", patches, "Independent patches to check it with")
      ->capture_default_str()
      ->check(CLI::Range(1, 10000));
  line.parse();

  VENEER_ASSIGN(const std::unique_ptr<simulation::Bench> bench,
                simulation::Bench::load(bench_path));
  simulation::VirtualPatchDisplay display(*bench);
  simulation::VirtualColorimeter colorimeter(*bench, display, {});
  VENEER_ASSIGN(const calibration::MeasuredProfile measured,
                measure_profile_on_bench(*bench, display, colorimeter, line.progress()));
  for (const std::string& warning : measured.warnings) line.note("warning: " + warning);
  VENEER_TRY(measured.profile.save(out));

  constexpr std::uint64_t kSeed = 1;
  VENEER_ASSIGN(const calibration::ProfileVerification verification,
                calibration::verify_profile(
                    colorimeter,
                    display,
                    measured.profile,
                    calibration::verification_patches(measured.profile, patches, kSeed),
                    line.progress()));
  line.print(
      {{"profile", out.string()},
       {"readings", measured.readings},
       {"additivity_error", measured.additivity_error},
       {"de00_mean", verification.de00_mean},
       {"de00_p95", verification.de00_p95},
       {"de00_max", verification.de00_max}},
      fmt::format(
          "wrote {} from {} readings; it predicts {} other patches to dE00 {:.2f} mean, {:.2f} max",
          out.string(),
          measured.readings,
          patches,
          verification.de00_mean,
          verification.de00_max));
  return kExitDone;
}

}  // namespace veneer::cli
