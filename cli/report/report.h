// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>

#include "base/result.h"
#include "cli/report/verification.h"

namespace veneer::cli {

/// What the demo promises of its own scene. Looser for nobody: a user's material is only reported.
struct QualityGates {
  double de00_mean = 1.5;          ///< at most, in gamut
  double de00_p95 = 4.0;           ///< at most, in gamut
  double in_gamut = 0.9;           ///< at least, of the covered pixels
  double uncompensated_ratio = 3;  ///< the mean without compensation over that with it, at least
};

/// What report.json says; `run` is the summary that veneerd wrote.
[[nodiscard]] nlohmann::ordered_json report_json(const nlohmann::json& run,
                                                 const RunVerification& verification,
                                                 const QualityGates& gates,
                                                 const std::string& material,
                                                 const std::string& mesh);

/// Whether every gate of a report is met.
[[nodiscard]] bool gates_met(const nlohmann::ordered_json& report);

/// Writes report.json and index.html beside the folder `pictures` that verify_run() filled.
/// @param run_folder  where frames.csv is.
[[nodiscard]] Status write_report(const nlohmann::ordered_json& report,
                                  const RunVerification& verification,
                                  const std::filesystem::path& run_folder);

}  // namespace veneer::cli
