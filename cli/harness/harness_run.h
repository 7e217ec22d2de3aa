// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "cli/harness/scenario.h"
#include "render/scene.h"

namespace veneer::cli {

/// What veneerd left of a rehearsal, frame by frame, beside the truth.
struct HarnessRun {
  struct Event {
    double seconds = 0;
    std::string state;
    std::string detail;
  };
  std::vector<double> seconds;  ///< moment of display of each frame, since the tracker was opened
  /// Values of each frame by the name of the quantity; NaN where a frame has none.
  ///
  ///   position_error_mm   the shown eye from the true one
  ///   view_error_deg      the same as an angle at the object
  ///   step_mm             the shown eye from that of the frame before, less the true step
  ///   specular_weight     how much of the highlights is shown, 0 to 1
  ///   pose_age_ms, observer (a body's number)
  ///   presence.NAME       1 where the observer is "tracked", "held", "stale", "lost", else 0
  ///   tracker.NAME        1 where the tracker is "absent", "tracking" and so on, else 0
  ///   picture_de00        mean colour difference over the object, from the picture for the true
  ///                       eye; of each frame that was kept
  std::map<std::string, std::vector<double>> quantities;
  std::map<std::string, double> counters;  ///< of the whole run
  std::vector<Event> events;               ///< changes of the tracker's state
};

/// @param folder  with frames.csv, run.json, material.safetensors, profile and frames of a run.
/// Errors: kNotFound, kBadFormat, kUnavailable (no GL).
[[nodiscard]] Result<HarnessRun> read_harness_run(const Scenario& scenario,
                                                  const render::Scene& scene,
                                                  const std::filesystem::path& folder,
                                                  const std::filesystem::path& material,
                                                  const std::filesystem::path& profile,
                                                  Progress& progress);

/// An expectation and what became of it.
struct Verdict {
  Expectation expectation;
  double value = 0;  ///< NaN where nothing was measured
  bool met = false;
};
/// Errors: kInvalidOption (a quantity or counter that is not known; the text names those that are).
[[nodiscard]] Result<std::vector<Verdict>> judge(const std::vector<Expectation>& expectations,
                                                 const HarnessRun& run);

/// Writes verdict.json and index.html (one file, no network).
[[nodiscard]] Status write_harness_report(const Scenario& scenario,
                                          const HarnessRun& run,
                                          const std::vector<Verdict>& verdicts,
                                          const std::filesystem::path& folder);

}  // namespace veneer::cli
