// SPDX-License-Identifier: Apache-2.0
#include "quality/trade/run.h"

#include <nlohmann/json.hpp>
#include <sys/utsname.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fstream>
#include <limits>
#include <map>
#include <thread>

#include "base/image_files.h"
#include "base/journal.h"
#include "base/statistics.h"

namespace veneer::quality {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr JournalKind kJournalKind{
    .format = "veneer-trade",
    .doing = "going on with the report",
    .busy = "another `veneer trade` is at work in it; let that one finish, or name another folder",
    .restart = "name another folder, or delete this one to begin again"};

// The steps of the journal.
constexpr const char* kFit = "fit";
constexpr const char* kLeftOut = "left out";
constexpr const char* kScreen = "screen";
constexpr const char* kTiming = "timing";
constexpr const char* kTimings = "all";

/// Says of what the stages below it are.
class Prefixed final : public Progress {
 public:
  Prefixed(std::string prefix, Progress& progress)
      : prefix_(std::move(prefix)), progress_(progress) {}
  void start(std::string_view label, std::int64_t total) override {
    progress_.start(fmt::format("{}: {}", prefix_, label), total);
  }
  void advance(std::int64_t steps) override { progress_.advance(steps); }
  void finish(std::string_view remark) override { progress_.finish(remark); }

 private:
  std::string prefix_;
  Progress& progress_;
};

/// A figure of the journal, in which what is not finite is null.
double figure(const json& values, const char* key) {
  const json value = values.value(key, json());
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string text_of(const json& values, const char* key) {
  const json value = values.value(key, json());
  return value.is_string() ? value.get<std::string>() : "";
}

json to_json(const ScreenErrors& e) {
  return {{"screen_epsilon", e.target.epsilon},
          {"screen_rmse", e.target.rmse},
          {"de00_mean", e.target.de00_mean},
          {"de00_p95", e.target.de00_p95},
          {"de00_max", e.target.de00_max},
          {"received_de00_mean", e.received.de00_mean},
          {"received_de00_p95", e.received.de00_p95},
          {"received_de00_max", e.received.de00_max}};
}

void take_screen(const json& values, TradePoint& point) {
  point.screen_epsilon = figure(values, "screen_epsilon");
  point.screen_rmse = figure(values, "screen_rmse");
  point.de00_mean = figure(values, "de00_mean");
  point.de00_p95 = figure(values, "de00_p95");
  point.de00_max = figure(values, "de00_max");
  point.received_de00_mean = figure(values, "received_de00_mean");
  point.received_de00_p95 = figure(values, "received_de00_p95");
  point.received_de00_max = figure(values, "received_de00_max");
}

std::string machine_name() {
  utsname system{};
  std::string processor = ::uname(&system) == 0 ? system.machine : "unknown processor";
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (!line.starts_with("model name")) continue;
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos) processor = line.substr(colon + 2);
    break;
  }
  return fmt::format("{}, {} threads", processor, std::thread::hardware_concurrency());
}

std::string date_now() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02} UTC",
                     utc.tm_year + 1900,
                     utc.tm_mon + 1,
                     utc.tm_mday,
                     utc.tm_hour,
                     utc.tm_min);
}

Status write_crop(const fs::path& path, const Seen& seen) {
  const int width = seen.crop.width();
  const int height = seen.crop.height();
  std::vector<ExrChannel> channels;
  for (const char* name : {"X", "Y", "Z"}) {
    const auto c = static_cast<Eigen::Index>(channels.size());
    Image<float> pixels(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) pixels(x, y) = seen.crop(x, y)[c];
    channels.push_back({name, std::move(pixels)});
  }
  channels.push_back({"dE00", seen.de00});
  return write_exr(path, channels);
}

class Runner {
 public:
  Runner(const TradeRun& run, const TradeTools& tools, Journal journal, Progress& progress)
      : run_(run), tools_(tools), journal_(std::move(journal)), progress_(progress) {}

  Result<Trade> trade(std::span<const Candidate> candidates) {
    VENEER_TRY(measure_errors(candidates));
    if (trade_.points.empty())
      return fail(Errc::kInvalidOption,
                  "measuring the trade: nothing could be measured; {}",
                  trade_.left_out.empty()
                      ? "the grid is empty"
                      : trade_.left_out.back().name + ": " + trade_.left_out.back().why);
    VENEER_TRY(measure_times());
    return std::move(trade_);
  }

 private:
  Status measure_errors(std::span<const Candidate> candidates) {
    std::map<std::string, int> number_of;
    for (const Candidate& c : candidates)
      number_of.emplace(c.fit_key(), static_cast<int>(number_of.size()) + 1);
    std::string fitted_key;
    Fitted fitted;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const Candidate& candidate = candidates[i];
      const std::string key = candidate.fit_key();
      if (key != fitted_key) {
        Prefixed progress(
            fmt::format("{} of {}, {}", number_of.at(key), number_of.size(), candidate.name()),
            progress_);
        VENEER_ASSIGN(fitted, fit(candidate, progress));
        fitted_key = key;
      }
      if (!fitted.why_not.empty()) {
        trade_.left_out.push_back({candidate.name(), fitted.why_not});
        continue;
      }
      progress_.start(
          fmt::format(
              "{} of {}, {}: errors on the screen", i + 1, candidates.size(), candidate.name()),
          1);
      VENEER_TRY(look(candidate, fitted));
      progress_.finish();
    }
    return {};
  }

  struct Fitted {
    TradeTools::MaterialPtr material;
    json figures;
    std::size_t bytes = 0;
    int fetches = 0;
    std::string why_not;  // empty: it is there
  };

  Result<Fitted> fit(const Candidate& candidate, Progress& progress) {
    const std::string key = candidate.fit_key();
    Fitted fitted;
    if (const json* why = journal_.find(kLeftOut, key); why != nullptr && why->is_string()) {
      fitted.why_not = why->get<std::string>();
      return fitted;
    }
    const fs::path path = material_path(run_.folder, candidate);
    if (const json* known = journal_.find(kFit, key)) {
      fitted.figures = *known;
      // A material that somebody took away, or damaged, is made anew.
      if (auto kept = btf::load_material(path)) fitted.material = std::move(*kept);
    }
    if (!fitted.material) {
      VENEER_TRY(make(candidate, path, fitted, progress));
      if (!fitted.why_not.empty()) return fitted;
    }
    const btf::ModelShader shader = fitted.material->shader();
    fitted.bytes = shader.gpu_bytes();
    fitted.fetches = shader.fetches;
    return fitted;
  }

  Status make(const Candidate& candidate,
              const fs::path& path,
              Fitted& fitted,
              Progress& progress) {
    const auto begin = std::chrono::steady_clock::now();
    auto material = tools_.fit(candidate, progress);
    if (!material && material.error().code == Errc::kInvalidOption) {
      fitted.why_not = material.error().what;
      return journal_.add(kLeftOut, candidate.fit_key(), fitted.why_not);
    }
    VENEER_TRY(material);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    fitted.material = std::move(*material);
    VENEER_ASSIGN(const SetErrors errors, tools_.set_errors(*fitted.material, progress));
    VENEER_TRY(btf::save_material(*fitted.material,
                                  path,
                                  {{"fitted_on", run_.source},
                                   {"clusters", std::to_string(candidate.fit.clusters)},
                                   {"components", candidate.fit.components},
                                   {"seed", std::to_string(candidate.fit.seed)}}));
    fitted.figures = {{"seconds", seconds.count()},
                      {"epsilon", errors.epsilon},
                      {"rmse", errors.rmse},
                      {"de00_mean", errors.de00_mean}};
    ++trade_.fitted;
    return journal_.add(kFit, candidate.fit_key(), fitted.figures);
  }

  Status look(const Candidate& candidate, const Fitted& fitted) {
    const std::string key = candidate.key();
    if (const json* why = journal_.find(kLeftOut, key); why != nullptr && why->is_string()) {
      trade_.left_out.push_back({candidate.name(), why->get<std::string>()});
      return {};
    }
    const fs::path path = crop_path(run_.folder, candidate);
    std::error_code ignored;
    json values;
    if (const json* known = journal_.find(kScreen, key);
        known != nullptr && fs::exists(path, ignored)) {
      values = *known;
    } else {
      const Result<Seen> seen = tools_.look(candidate, *fitted.material);
      if (!seen && seen.error().code == Errc::kInvalidOption) {
        trade_.left_out.push_back({candidate.name(), seen.error().what});
        return journal_.add(kLeftOut, key, seen.error().what);
      }
      if (!seen) return tl::unexpected(seen.error());
      VENEER_TRY(write_crop(path, *seen));
      values = to_json(seen->errors);
      VENEER_TRY(journal_.add(kScreen, key, values));
      ++trade_.looked;
    }
    TradePoint point;
    point.candidate = candidate;
    point.fit_seconds = figure(fitted.figures, "seconds");
    point.set_epsilon = figure(fitted.figures, "epsilon");
    point.set_rmse = figure(fitted.figures, "rmse");
    point.set_de00_mean = figure(fitted.figures, "de00_mean");
    point.gpu_bytes = static_cast<double>(fitted.bytes);
    point.fetches = fitted.fetches;
    take_screen(values, point);
    trade_.points.push_back(std::move(point));
    materials_.push_back(fitted.material);
    return {};
  }

  /// Takes what the journal has, if it is of just these points.
  bool take_times(const json& timing) {
    const json points = timing.value("points", json::object());
    if (!points.is_object() || points.size() != trade_.points.size()) return false;
    for (TradePoint& point : trade_.points) {
      const auto found = points.find(point.candidate.key());
      if (found == points.end()) return false;
      point.ms_median = figure(*found, "ms_median");
      point.ms_p95 = figure(*found, "ms_p95");
      point.ratio = figure(*found, "ratio");
      point.gpu_bytes = figure(*found, "gpu_bytes");
      point.cache_served = figure(*found, "cache_served");
    }
    trade_.renderer = text_of(timing, "renderer");
    trade_.clock = text_of(timing, "clock");
    trade_.machine = text_of(timing, "machine");
    trade_.date = text_of(timing, "date");
    trade_.plain_ms = figure(timing, "plain_ms");
    return true;
  }

  Status measure_times() {
    if (const json* known = journal_.find(kTiming, kTimings);
        known != nullptr && take_times(*known))
      return {};
    std::vector<double> plain;
    json points = json::object();
    std::vector<double> plain_of_point(trade_.points.size());
    json timing;
    for (std::size_t begin = 0; begin < trade_.points.size();) {
      const std::size_t end = end_of_batch(begin);
      std::vector<render::NamedLevel> levels;
      for (std::size_t i = begin; i < end; ++i)
        levels.push_back({trade_.points[i].candidate.name(),
                          {materials_[i].get(), trade_.points[i].candidate.drawing}});
      VENEER_ASSIGN(const render::RenderBenchResult result, tools_.time(levels, progress_));
      VENEER_CHECK(result.timings.size() > levels.size());
      plain.push_back(result.timings.front().ms_median);
      for (std::size_t i = begin; i < end; ++i) {
        const render::RenderTiming& t = result.timings[i - begin + 1];
        plain_of_point[i] = plain.back();
        points[trade_.points[i].candidate.key()] = {{"ms_median", t.ms_median},
                                                    {"ms_p95", t.ms_p95},
                                                    {"ratio", t.ratio},
                                                    {"gpu_bytes", t.gpu_bytes}};
        if (t.served) points[trade_.points[i].candidate.key()]["cache_served"] = *t.served;
      }
      timing["renderer"] = result.renderer;
      timing["clock"] = result.clock;
      begin = end;
    }
    const double common = quantile(plain, 0.5);
    for (std::size_t i = 0; i < trade_.points.size(); ++i) {
      json& point = points[trade_.points[i].candidate.key()];
      // The first batch's plain draw is its own yardstick: then the factor is exactly 1.
      const double factor = common / plain_of_point[i];
      for (const char* key : {"ms_median", "ms_p95"})
        point[key] = factor * point[key].get<double>();
    }
    timing["plain_ms"] = common;
    timing["machine"] = machine_name();
    timing["date"] = date_now();
    timing["points"] = std::move(points);
    VENEER_TRY(journal_.add(kTiming, kTimings, timing));
    VENEER_CHECK(take_times(timing));
    return {};
  }

  /// The first point after `begin` that no longer fits on the GPU beside those before it. A
  /// material counts once for each way in which it is drawn: so it is uploaded.
  [[nodiscard]] std::size_t end_of_batch(std::size_t begin) const {
    double bytes = 0;
    std::size_t end = begin;
    do {
      bytes += trade_.points[end].gpu_bytes;
      ++end;
    } while (end < trade_.points.size() && bytes + trade_.points[end].gpu_bytes <= run_.most_bytes);
    return end;
  }

  const TradeRun& run_;
  const TradeTools& tools_;
  Journal journal_;
  Progress& progress_;
  Trade trade_;
  std::vector<TradeTools::MaterialPtr> materials_;  // of each point
};

}  // namespace

fs::path material_path(const fs::path& folder, const Candidate& candidate) {
  return folder / "materials" / (candidate.fit_key() + ".safetensors");
}

fs::path crop_path(const fs::path& folder, const Candidate& candidate) {
  return folder / "crops" / (candidate.key() + ".exr");
}

Result<Trade> run_trade(const TradeRun& run,
                        std::span<const Candidate> candidates,
                        const TradeTools& tools,
                        Progress& progress) {
  json identity = json::object();
  for (const auto& [name, value] : run.identity) identity[name] = value;
  VENEER_ASSIGN(Journal journal, Journal::open(kJournalKind, run.folder, identity));
  Runner runner(run, tools, std::move(journal), progress);
  return runner.trade(candidates);
}

}  // namespace veneer::quality
