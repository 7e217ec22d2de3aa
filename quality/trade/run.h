// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"
#include "btf/material.h"
#include "quality/candidate.h"
#include "quality/screen_reference.h"
#include "quality/trade/grid.h"
#include "render/benchmark.h"

namespace veneer::quality {

/// Errors in the set, at the measured directions, encoded.
struct SetErrors {
  double epsilon = 0;
  double rmse = 0;
  double de00_mean = 0;
};

/// What one way to draw shows.
struct Seen {
  ScreenErrors errors;
  Image<Rgb32f> crop;  ///< a part of the first viewpoint's frame: the target, XYZ in cd/m^2
  Image<float> de00;   ///< of the crop to the reference; NaN where they are not compared
};

/// What a run asks of the world. Tests give exact figures; scene_tools() gives the real ones.
struct TradeTools {
  using MaterialPtr = std::shared_ptr<const btf::Material>;
  /// Errors: kInvalidOption where the set or the machine does not allow this candidate: it is left
  /// out, and the report says so. So for `look`.
  std::function<Result<MaterialPtr>(const Candidate& candidate, Progress& progress)> fit;
  std::function<Result<SetErrors>(const btf::Material& material, Progress& progress)> set_errors;
  std::function<Result<Seen>(const Candidate& candidate, const btf::Material& material)> look;
  /// Times the levels in one interleaved run; "plain" first, then the levels in order.
  std::function<Result<render::RenderBenchResult>(std::span<const render::NamedLevel> levels,
                                                  Progress& progress)>
      time;
};

/// What came of a run.
struct Trade {
  std::vector<TradePoint> points;  ///< in the grid's order
  struct LeftOut {
    std::string name;
    std::string why;
  };
  std::vector<LeftOut> left_out;
  std::string renderer;
  std::string clock;
  std::string machine;
  std::string date;  ///< of the timing, UTC
  double plain_ms = 0;
  int fitted = 0;  ///< in this run; the others were there from before
  int looked = 0;  ///< likewise
};

struct TradeRun {
  /// Holds journal.jsonl, materials/FIT_KEY.safetensors and crops/KEY.exr (X, Y, Z, dE00).
  std::filesystem::path folder;
  /// What must be the same for a journal to hold: text by name, such as "scene".
  std::vector<std::pair<std::string, std::string>> identity;
  /// Noted in the materials: where their samples come from.
  std::string source;
  /// Materials that are timed in one run take at most this much of the GPU, bytes.
  double most_bytes = 3e9;
};

/// Fits each distinct fit once, measures each candidate's errors and then times all together. What
/// the journal has is not done again; timings that were not finished are redone whole.
/// Where all do not fit on the GPU at once they are timed in several runs, and milliseconds are
/// those of the ratios to one plain draw, so that a change of the machine's load between runs does
/// not count. Errors: those of the tools and of Journal::open; kInvalidOption where everything was
/// left out.
[[nodiscard]] Result<Trade> run_trade(const TradeRun& run,
                                      std::span<const Candidate> candidates,
                                      const TradeTools& tools,
                                      Progress& progress);

/// Where the material of a fit is kept.
[[nodiscard]] std::filesystem::path material_path(const std::filesystem::path& folder,
                                                  const Candidate& candidate);
/// Where a candidate's crop is kept: channels X, Y, Z and dE00.
[[nodiscard]] std::filesystem::path crop_path(const std::filesystem::path& folder,
                                              const Candidate& candidate);

}  // namespace veneer::quality
