// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "quality/candidate.h"
#include "render/drawing.h"

namespace veneer::quality {

/// One step of the measured front, as the daemon draws it.
struct Rung {
  std::string name;                ///< for people, and for the status: Candidate::name()
  std::filesystem::path material;  ///< NAME.safetensors
  render::DrawingOptions drawing;
  double ratio = 1;      ///< measured cost over a plain draw's; only how rungs compare matters
  double de00_mean = 0;  ///< measured error on the screen
};

/// The front from the best picture (first) to the cheapest (last): errors ascend, costs descend.
/// ladder.toml, written by `veneer trade`, read by veneerd ([quality] ladder). Paths in it are
/// relative to its folder.
///
///     [[rung]]
///     name = "texel-colours 6+2"
///     material = "materials/texel-colours-6+2.safetensors"
///     ratio = 5.2
///     de00_mean = 0.61
///     average_texels = true      # and what else [render] has: cache_spacing_px, scale ...
struct Ladder {
  std::vector<Rung> rungs;  ///< 1 to kMost

  static constexpr std::size_t kMost = 8;
  /// Errors: kNotFound; kInvalidOption (an unknown key, no rungs, costs that do not descend).
  [[nodiscard]] static Result<Ladder> load(const std::filesystem::path& path);
  [[nodiscard]] Status save(const std::filesystem::path& path) const;
};

/// What can be taken off one material without another fit: texel averaging, then the angular cache
/// where the model offers it, then the scale. The ratios are estimates until they are measured.
[[nodiscard]] Ladder ladder_of(const std::filesystem::path& material,
                               bool offers_cache,
                               const render::DrawingOptions& best);

/// The measured front of error against time (pareto_front), thinned until each rung costs clearly
/// less than the one before it and no more than kMost are left. Empty where no point is finite.
/// @param materials  the folder that holds Candidate::fit_key().safetensors
[[nodiscard]] Ladder ladder_of(std::span<const TradePoint> points,
                               const std::filesystem::path& materials);

}  // namespace veneer::quality
