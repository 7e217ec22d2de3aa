// SPDX-License-Identifier: Apache-2.0
#include "cli/track/report.h"

#include <nlohmann/json.hpp>

#include <array>
#include <string_view>

namespace veneer::cli {
namespace {

using tracking::TrackerCounters;

struct Counter {
  std::string_view key;  // in JSON
  std::string_view text;
  std::uint64_t TrackerCounters::*value;
};

constexpr std::array kCounters{
    Counter{"samples", "samples", &TrackerCounters::samples},
    Counter{"lost", "lost", &TrackerCounters::lost},
    Counter{"duplicates", "duplicates", &TrackerCounters::duplicates},
    Counter{"late", "late", &TrackerCounters::late},
    Counter{"suspect", "suspect", &TrackerCounters::suspect},
    Counter{"skipped_bytes", "bytes skipped", &TrackerCounters::skipped_bytes},
    Counter{"bad_frames", "bad frames", &TrackerCounters::bad_frames},
    Counter{"clock_outliers", "clock outliers", &TrackerCounters::clock_outliers},
    Counter{"clock_restarts", "clock restarts", &TrackerCounters::clock_restarts},
    Counter{"io_errors", "transfer errors", &TrackerCounters::io_errors},
    Counter{"restarts", "told again", &TrackerCounters::restarts},
    Counter{"opened", "opened", &TrackerCounters::opened},
    Counter{"open_errors", "could not be opened", &TrackerCounters::open_errors},
};

constexpr double kMilliseconds = 1e3;  // per second

}  // namespace

std::string state_line(const tracking::Tracker& tracker) {
  const tracking::TrackerStatus status = tracker.status();
  return fmt::format("{}: {}{}{}",
                     tracker.description(),
                     name_of(status.state),
                     status.detail.empty() ? "" : ", ",
                     status.detail);
}

std::vector<std::string> body_table(const BodyStatistics& whole, const BodyStatistics& recent) {
  std::vector<std::string> lines{fmt::format("{:>5} {:>9} {:>8} {:>15} {:>10} {:>8}   {}",
                                             "body",
                                             "samples",
                                             "rate Hz",
                                             "latency, max ms",
                                             "jitter ms",
                                             "lost",
                                             "position m")};
  for (const auto& [body, all] : whole) {
    const auto found = recent.find(body);
    const PoseStatistics now = found == recent.end() ? PoseStatistics{} : found->second;
    const Eigen::Vector3d& position = all.newest()->world_from_body.translation;
    lines.push_back(
        fmt::format("{:>5} {:>9} {:>8.1f} {:>7.1f} {:>7.1f} {:>10.2f} {:>8}   "
                    "{:+.4f} {:+.4f} {:+.4f}",
                    body,
                    all.samples(),
                    now.rate_hz(),
                    kMilliseconds * now.latency_s().mean(),
                    kMilliseconds * now.latency_s().max(),
                    kMilliseconds * now.interval_s().deviation(),
                    all.lost(),
                    position.x(),
                    position.y(),
                    position.z()));
  }
  return lines;
}

std::string trouble_line(const TrackerCounters& counters) {
  std::string line;
  for (const Counter& counter : kCounters) {
    const std::uint64_t value = counters.*counter.value;
    // Samples are in the table; being opened once is as it should be.
    const bool is_trouble = counter.value == &TrackerCounters::opened ? value > 1 : value > 0;
    if (!is_trouble || counter.value == &TrackerCounters::samples) continue;
    line += fmt::format("{}{} {}", line.empty() ? "" : ", ", value, counter.text);
  }
  return line;
}

nlohmann::ordered_json json_of(const BodyStatistics& bodies) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& [body, statistics] : bodies) {
    const Eigen::Vector3d& position = statistics.newest()->world_from_body.translation;
    const Eigen::Quaterniond& rotation = statistics.newest()->world_from_body.rotation;
    list.push_back({{"body", body},
                    {"samples", statistics.samples()},
                    {"lost", statistics.lost()},
                    {"out_of_order", statistics.out_of_order()},
                    {"rate_hz", statistics.rate_hz()},
                    {"duration_s", to_seconds(statistics.duration())},
                    {"latency_ms_mean", kMilliseconds * statistics.latency_s().mean()},
                    {"latency_ms_max", kMilliseconds * statistics.latency_s().max()},
                    {"jitter_ms", kMilliseconds * statistics.interval_s().deviation()},
                    {"longest_gap_ms", kMilliseconds * statistics.interval_s().max()},
                    {"position_m", {position.x(), position.y(), position.z()}},
                    {"rotation_wxyz", {rotation.w(), rotation.x(), rotation.y(), rotation.z()}}});
  }
  return list;
}

nlohmann::ordered_json json_of(const tracking::TrackerStatus& status) {
  nlohmann::ordered_json counters;
  for (const Counter& counter : kCounters)
    counters[std::string(counter.key)] = status.counters.*counter.value;
  return {{"state", name_of(status.state)}, {"detail", status.detail}, {"counters", counters}};
}

}  // namespace veneer::cli
