// SPDX-License-Identifier: Apache-2.0
#include "cli/trade/report.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "base/files.h"
#include "base/image_files.h"
#include "base/report_page.h"
#include "base/statistics.h"
#include "cli/report/pictures.h"
#include "quality/ladder.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using quality::TradePoint;

constexpr char kPage[] =
#include "cli/trade/index.html.inc"
    ;

// The difference map's yellow end: plain to see side by side.
constexpr double kMostDe00 = 10;

struct Figure {
  const char* name;
  double TradePoint::*value;
};
constexpr std::array kFigures{
    Figure{"ms_median", &TradePoint::ms_median},
    Figure{"ms_p95", &TradePoint::ms_p95},
    Figure{"ratio", &TradePoint::ratio},
    Figure{"gpu_bytes", &TradePoint::gpu_bytes},
    Figure{"fit_seconds", &TradePoint::fit_seconds},
    Figure{"epsilon_avg", &TradePoint::set_epsilon},
    Figure{"rmse", &TradePoint::set_rmse},
    Figure{"set_de00_mean", &TradePoint::set_de00_mean},
    Figure{"screen_epsilon", &TradePoint::screen_epsilon},
    Figure{"screen_rmse", &TradePoint::screen_rmse},
    Figure{"de00_mean", &TradePoint::de00_mean},
    Figure{"de00_p95", &TradePoint::de00_p95},
    Figure{"de00_max", &TradePoint::de00_max},
    Figure{"received_de00_mean", &TradePoint::received_de00_mean},
    Figure{"received_de00_p95", &TradePoint::received_de00_p95},
    Figure{"received_de00_max", &TradePoint::received_de00_max},
    Figure{"cache_served", &TradePoint::cache_served},
};

ordered_json number_or_null(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

/// What is fitted and drawn, by the names that the command line gives it.
ordered_json options_json(const quality::Candidate& candidate) {
  const quality::FitReads reads = quality::reads_of(candidate.model);
  const btf::FitOptions& fit = candidate.fit;
  ordered_json json;
  const auto model = btf::find_model(candidate.model);
  if (!model || (*model)->terms > 0) json["components"] = fit.components;
  if (reads.lobes) json["lobes"] = fit.lobes;
  if (reads.layers) json["layers"] = fit.layers;
  if (reads.clusters) json["clusters"] = fit.clusters;
  if (reads.angular) json["angular"] = fit.angular;
  if (reads.precision) json["precision"] = fit.precision;
  json["average_texels"] = candidate.drawing.average_texels;
  if (reads.cache) json["cache_spacing_px"] = candidate.drawing.cache.spacing;
  json["scale"] = candidate.drawing.scale;
  return json;
}

std::set<std::size_t> front(const quality::Trade& trade, double TradePoint::*cost) {
  const auto points = quality::pareto_front(trade.points, cost);
  return {points.begin(), points.end()};
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = word << 8U | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? kDigits[word >> (18U - 6U * k) & 63U] : '=';
  }
  return text;
}

/// A picture as an address that holds it.
Result<std::string> data_uri(const Image<Rgb8>& picture, const fs::path& folder) {
  const fs::path scratch = folder / "crops" / "picture.png";
  VENEER_TRY(write_png(scratch, picture.view()));
  VENEER_ASSIGN(const std::string bytes, read_text(scratch));
  std::error_code ignored;
  fs::remove(scratch, ignored);
  return "data:image/png;base64," + base64(bytes);
}

/// What is shown as white: the profile's, or where the scene is dimmer, nearly its brightest.
double shown_white(const Image<Rgb32f>& reference, double white_nits) {
  std::vector<double> luminances;
  for (const Rgb32f& xyz : reference.pixels())
    if (std::isfinite(xyz.y())) luminances.push_back(xyz.y());
  const double bright = 1.1 * quantile(std::move(luminances), 0.99);
  return bright > 0 ? std::min(white_nits, bright) : white_nits;
}

Image<Rgb8> picture(const Image<Rgb32f>& xyz, double white) {
  Image<Rgb32f> known = xyz;
  for (Rgb32f& pixel : known.pixels())
    if (!pixel.allFinite()) pixel.setZero();
  return picture_of_xyz(known.view(), white);
}

Status add_crops(const quality::Trade& trade,
                 const TradeAbout& about,
                 const Image<Rgb32f>& reference,
                 const fs::path& folder,
                 ordered_json& data) {
  const double white = shown_white(reference, about.white_nits);
  VENEER_ASSIGN(std::string shown, data_uri(picture(reference, white), folder));
  VENEER_ASSIGN(std::string legend, data_uri(difference_legend(160, 8), folder));
  data["reference"] = std::move(shown);
  data["legend"] = std::move(legend);
  data["difference_scale"] = kMostDe00;
  data["shown_white_nits"] = white;
  ordered_json& crops = data["crops"] = ordered_json::array();
  for (const TradePoint& point : trade.points) {
    const fs::path path = quality::crop_path(folder, point.candidate);
    VENEER_ASSIGN(const std::vector<ExrChannel> channels, read_exr(path));
    const auto channel = [&channels](std::string_view name) {
      const auto found = std::ranges::find(channels, name, &ExrChannel::name);
      return found == channels.end() ? nullptr : &found->pixels;
    };
    const std::array<const Image<float>*, 4> planes{
        channel("X"), channel("Y"), channel("Z"), channel("dE00")};
    if (std::ranges::find(planes, nullptr) != planes.end())
      return fail(Errc::kBadFormat,
                  "reading {}: it holds no X, Y, Z and dE00; delete it and run again",
                  path.string());
    Image<Rgb32f> crop(planes[0]->width(), planes[0]->height());
    for (std::size_t i = 0; i < crop.pixels().size(); ++i)
      crop.pixels()[i] = {planes[0]->pixels()[i], planes[1]->pixels()[i], planes[2]->pixels()[i]};
    VENEER_ASSIGN(std::string drawn, data_uri(picture(crop, white), folder));
    VENEER_ASSIGN(std::string difference,
                  data_uri(picture_of_differences(planes[3]->view(), kMostDe00), folder));
    crops.push_back({{"drawn", std::move(drawn)}, {"difference", std::move(difference)}});
  }
  return {};
}

}  // namespace

ordered_json trade_json(const quality::Trade& trade, const TradeAbout& about) {
  ordered_json json{{"set", about.set},
                    {"scene", about.scene},
                    {"profile", about.profile},
                    {"grid", about.grid},
                    {"views", about.views},
                    {"frames", about.frames},
                    {"renderer", trade.renderer},
                    {"clock", trade.clock},
                    {"machine", trade.machine},
                    {"date", trade.date},
                    {"plain_ms", number_or_null(trade.plain_ms)},
                    {"least_gain_de00", quality::kLeastGain}};
  const std::set<std::size_t> by_time = front(trade, &TradePoint::ms_median);
  const std::set<std::size_t> by_bytes = front(trade, &TradePoint::gpu_bytes);
  ordered_json& candidates = json["candidates"] = ordered_json::array();
  for (std::size_t i = 0; i < trade.points.size(); ++i) {
    const TradePoint& point = trade.points[i];
    ordered_json entry{{"name", point.candidate.name()},
                       {"key", point.candidate.key()},
                       {"model", point.candidate.model},
                       {"options", options_json(point.candidate)},
                       {"fetches", point.fetches}};
    for (const Figure& figure : kFigures) entry[figure.name] = number_or_null(point.*figure.value);
    entry["idle_cache"] = point.has_idle_cache();
    entry["pareto"] = by_time.contains(i);
    entry["pareto_bytes"] = by_bytes.contains(i);
    candidates.push_back(std::move(entry));
  }
  ordered_json& left_out = json["left_out"] = ordered_json::array();
  for (const auto& [name, why] : trade.left_out) left_out.push_back({{"name", name}, {"why", why}});
  if (about.chosen) json["chosen"] = trade.points[*about.chosen].candidate.key();
  return json;
}

std::string trade_csv(const quality::Trade& trade) {
  std::string text = "name,model,fetches";
  for (const Figure& figure : kFigures) text += fmt::format(",{}", figure.name);
  text += ",pareto,pareto_bytes\n";
  const std::set<std::size_t> by_time = front(trade, &TradePoint::ms_median);
  const std::set<std::size_t> by_bytes = front(trade, &TradePoint::gpu_bytes);
  for (std::size_t i = 0; i < trade.points.size(); ++i) {
    const TradePoint& point = trade.points[i];
    // Names hold commas.
    text +=
        fmt::format("\"{}\",{},{}", point.candidate.name(), point.candidate.model, point.fetches);
    for (const Figure& figure : kFigures) {
      const double value = point.*figure.value;
      text += std::isfinite(value) ? fmt::format(",{:.9g}", value) : ",";
    }
    text += fmt::format(",{:d},{:d}\n", by_time.contains(i), by_bytes.contains(i));
  }
  return text;
}

std::string idle_caches_in_words(const quality::Trade& trade) {
  std::vector<double> percent;
  for (const TradePoint& point : trade.points)
    if (point.has_idle_cache()) percent.push_back(100 * point.cache_served);
  if (percent.empty()) return "";
  const auto [least, most] = std::ranges::minmax(percent);
  const std::string least_text = fmt::format("{:.2g}", least);
  const std::string most_text = fmt::format("{:.2g}", most);
  return fmt::format(
      "{} with the angular cache {} not among them: in this scene {} % of the surface is drawn "
      "from "
      "it, and under 1 % it only costs time",
      percent.size(),
      percent.size() == 1 ? "is" : "are",
      least_text == most_text ? most_text : fmt::format("{} to {}", least_text, most_text));
}

Status write_trade_report(const quality::Trade& trade,
                          const TradeAbout& about,
                          const Image<Rgb32f>& reference,
                          const fs::path& folder) {
  ordered_json data = trade_json(trade, about);
  VENEER_TRY(write_text(folder / "trade.json", data.dump(2) + "\n"));
  VENEER_TRY(write_text(folder / "trade.csv", trade_csv(trade)));
  const quality::Ladder ladder = quality::ladder_of(trade.points, folder / "materials");
  if (!ladder.rungs.empty()) VENEER_TRY(ladder.save(folder / "ladder.toml"));
  VENEER_TRY(add_crops(trade, about, reference, folder, data));
  return write_text(folder / "index.html", page_with_data(kPage, data));
}

}  // namespace veneer::cli
