// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "tracking/drivers/simulated/path.h"
#include "tracking/drivers/simulated_device/fault_plan.h"

namespace veneer::cli {

/// One [[expect]] table: a statistic of a quantity over a span of time, and its bounds.
struct Expectation {
  std::string quantity;           ///< a column of HarnessRun, or "counter.NAME"
  std::string statistic = "max";  ///< max, min, mean, rms, p50, p95 or last
  double from_s = 0;              ///< since the tracker was opened, at the moment of display
  double to_s = 1e9;
  std::optional<double> at_most;
  std::optional<double> at_least;
  std::string why;  ///< what it guards, for people
};

/// From when on whose eye the picture ought to be for.
struct TrueObserver {
  double from_s = 0;
  tracking::BodyId body = 0;
};

/// A rehearsal of the daemon: a veneer.toml with a simulated tracker, faults, and what is expected
/// of the frames. The tables [scenario] and [[expect]] are the harness's; all others are veneerd's.
struct Scenario {
  std::filesystem::path path;
  std::filesystem::path scene;
  std::string about;
  std::vector<TrueObserver> observers;  ///< by time; never empty
  std::vector<tracking::Fault> faults;
  std::map<tracking::BodyId, tracking::Path> paths;
  std::vector<Expectation> expectations;

  /// @param settings  "key = value" lines that replace what the file says.
  /// Errors: kNotFound, kInvalidOption.
  [[nodiscard]] static Result<Scenario> load(const std::filesystem::path& path,
                                             const std::vector<std::string>& settings);
  [[nodiscard]] std::string name() const { return path.stem().string(); }
  /// Whose eye the picture ought to be for.
  [[nodiscard]] tracking::BodyId observer_at(double seconds) const;
};

}  // namespace veneer::cli
