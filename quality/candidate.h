// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "btf/material.h"
#include "render/drawing.h"

namespace veneer::quality {

/// One way to draw a material: what is fitted, and how it is drawn.
struct Candidate {
  std::string model;
  btf::FitOptions fit;
  render::DrawingOptions drawing;

  /// For people: "texel-colours 3+1, 32 clusters, cache 16, scale 0.5"; only what the model reads
  /// and what is not the default.
  [[nodiscard]] std::string name() const;
  /// For files: the same candidate has the same key, another one another. Letters, digits, - . +
  [[nodiscard]] std::string key() const;
  /// Of what is fitted alone: candidates that share it share a material.
  [[nodiscard]] std::string fit_key() const;
};

/// Which fields of btf::FitOptions a model reads beside its components: what its candidates differ
/// in. Of models that are not known here, all.
struct FitReads {
  bool clusters = true;  ///< and how they are found: basis, iterations, seed
  bool angular = true;
  bool lobes = true;
  bool layers = true;  ///< and where they lie: heights
  bool precision = true;
  bool dichromatic = true;  ///< form, specular, clustering
  bool mip_levels = true;
  bool cache = true;  ///< may be drawn from the angular cache
};
[[nodiscard]] FitReads reads_of(std::string_view model);

/// What a way to draw costs and how far off it is: a point of the trade.
struct TradePoint {
  Candidate candidate;
  double ms_median = 0;  ///< of the draw pass, GL timer
  double ms_p95 = 0;
  double ratio = 0;  ///< of the medians, to a plain textured draw of the same scene
  double gpu_bytes = 0;
  int fetches = 0;  ///< texture fetches a pixel and light
  double fit_seconds = 0;
  double set_epsilon = 0;  ///< in the set, encoded, as in the literature's tables
  double set_rmse = 0;
  double set_de00_mean = 0;
  double screen_epsilon = 0;  ///< on the screen, before compensation
  double screen_rmse = 0;
  double de00_mean = 0;  ///< on the screen, before compensation
  double de00_p95 = 0;
  double de00_max = 0;
  double received_de00_mean = 0;  ///< on the screen, after compensation and quantisation
  double received_de00_p95 = 0;
  double received_de00_max = 0;
  /// The part of the triangles that came from the angular cache; NaN where it is off or unknown.
  double cache_served = std::numeric_limits<double>::quiet_NaN();

  /// Draws what it would without a cache, and fills one beside: under 1 % comes from it.
  [[nodiscard]] bool has_idle_cache() const;
};

/// Mean dE00 by which a dearer way must be nearer to be worth anything: a fiftieth of what is seen
/// (0.5), and what a mean over 4 x 2000 pixels moves by when others are compared
/// (docs/howto/trade.md).
constexpr double kLeastGain = 0.01;

/// Which of `points` are worth their cost. With `least_gain` 0 those that no other one beats: of
/// two points one beats the other if it is no worse in `cost` and `error` and better in one. Above
/// 0, from the cheapest on, a point must have less error than the last one by that much, so that
/// what is left out is at most `least_gain` nearer than a point of the front that costs no more.
/// Sorted by cost, cheapest first. Points that are not finite or have an idle cache are on no
/// front.
/// @param least_gain  in the unit of `error`, >= 0.
[[nodiscard]] std::vector<std::size_t> pareto_front(std::span<const TradePoint> points,
                                                    double TradePoint::*cost,
                                                    double TradePoint::*error,
                                                    double least_gain);

/// The front of the error received against a cost, with kLeastGain: what reports and the daemon's
/// ladder go by.
[[nodiscard]] std::vector<std::size_t> pareto_front(std::span<const TradePoint> points,
                                                    double TradePoint::*cost);

/// What a point must keep to; nothing where not asked for.
struct Budget {
  std::optional<double> ms;
  std::optional<double> mb;    ///< of GPU memory, 1e6 bytes
  std::optional<double> de00;  ///< the mean after compensation
};
/// The cheapest of those that keep to the budget and have its least error, or kLeastGain more at
/// most. Where only de00 is given, the cheapest that keeps to it. None with an idle cache. Errors:
/// kInvalidOption, naming the nearest miss of each bound.
[[nodiscard]] Result<std::size_t> choose(std::span<const TradePoint> points, const Budget& budget);

}  // namespace veneer::quality
