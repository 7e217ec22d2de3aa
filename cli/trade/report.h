// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <optional>
#include <string>

#include "base/image.h"
#include "base/result.h"
#include "quality/trade/run.h"

namespace veneer::cli {

/// What a report says beside what was measured.
struct TradeAbout {
  std::string set;
  std::string scene;
  std::string profile;
  std::string grid;
  int views = 0;
  int frames = 0;
  double white_nits = 0;              ///< luminance of the profile's white; > 0
  std::optional<std::size_t> chosen;  ///< the point that keeps to the budget
};

/// trade.json: candidates in the grid's order with every figure, "pareto" (on the front of the
/// error received against milliseconds) and "pareto_bytes"; what was left out, and why.
[[nodiscard]] nlohmann::ordered_json trade_json(const quality::Trade& trade,
                                                const TradeAbout& about);

/// A line a candidate, the same figures.
[[nodiscard]] std::string trade_csv(const quality::Trade& trade);

/// How many ways with the angular cache are kept off the front since hardly anything is drawn from
/// it (TradePoint::has_idle_cache), with the shares that were measured; empty where there are none.
[[nodiscard]] std::string idle_caches_in_words(const quality::Trade& trade);

/// Writes trade.json, trade.csv, ladder.toml (where there is a front) and index.html, one file
/// that needs no other and no network.
/// @param folder  of the run: its crops are read.  @param reference  what the full BTF asks for in
/// the crop, XYZ in cd/m^2, NaN where nothing is compared.
[[nodiscard]] Status write_trade_report(const quality::Trade& trade,
                                        const TradeAbout& about,
                                        const Image<Rgb32f>& reference,
                                        const std::filesystem::path& folder);

}  // namespace veneer::cli
