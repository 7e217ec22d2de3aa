// SPDX-License-Identifier: Apache-2.0
#pragma once

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
};

/// Which of `points` no other one beats: of two points one beats the other if it is no worse in
/// `cost` and `error` and better in one. Sorted by cost, cheapest first. Points that are not finite
/// are on no front.
[[nodiscard]] std::vector<std::size_t> pareto_front(std::span<const TradePoint> points,
                                                    double TradePoint::*cost,
                                                    double TradePoint::*error);

/// What a point must keep to; nothing where not asked for.
struct Budget {
  std::optional<double> ms;
  std::optional<double> mb;    ///< of GPU memory, 1e6 bytes
  std::optional<double> de00;  ///< the mean after compensation
};
/// The point of least error that keeps to the budget; of equal ones the cheaper. Where only de00 is
/// given, the cheapest that keeps to it. Errors: kInvalidOption, naming the nearest miss of each
/// bound.
[[nodiscard]] Result<std::size_t> choose(std::span<const TradePoint> points, const Budget& budget);

}  // namespace veneer::quality
