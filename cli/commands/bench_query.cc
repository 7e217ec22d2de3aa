// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_query.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

#include "base/exit_code.h"
#include "base/statistics.h"
#include "tracking/pose_track.h"

namespace veneer::cli {
namespace {

using std::chrono::steady_clock;

constexpr double kTracker_hz = 1000;  // faster than any tracker there is a driver for
constexpr int kQueries = 400000;
constexpr Duration kAhead = std::chrono::milliseconds(20);

void add_samples(tracking::PoseTrack& track, const std::atomic<bool>& stop) {
  const Time start = steady_clock::now();
  for (std::uint64_t i = 0; !stop; ++i) {
    tracking::PoseSample sample;
    sample.sequence = i;
    sample.time = start + from_seconds(static_cast<double>(i) / kTracker_hz);
    sample.world_from_body.translation = {0.1 * std::sin(5e-3 * static_cast<double>(i)), 0.2, 1};
    sample.world_from_body.rotation =
        Eigen::AngleAxisd(1e-3 * static_cast<double>(i), Eigen::Vector3d::UnitY());
    (void)track.add(sample);
    std::this_thread::sleep_until(sample.time + from_seconds(1 / kTracker_hz));
  }
}

double nanoseconds_of(steady_clock::duration duration) {
  return std::chrono::duration<double, std::nano>(duration).count();
}

}  // namespace

Result<int> bench_query(CommandLine& line) {
  tracking::PoseTrack track{{}};
  std::atomic<bool> stop{false};
  std::jthread writer([&track, &stop] { add_samples(track, stop); });
  std::this_thread::sleep_for(std::chrono::milliseconds(200));  // a whole velocity window

  std::vector<double> query_ns;
  std::vector<double> clock_ns;
  double checked = 0;  // so that no query can be left out
  for (int i = 0; i < kQueries; ++i) {
    const auto before = steady_clock::now();
    const auto between = steady_clock::now();
    const tracking::PoseEstimate estimate = track.at(between + kAhead);
    const auto after = steady_clock::now();
    clock_ns.push_back(nanoseconds_of(between - before));
    query_ns.push_back(nanoseconds_of(after - between));
    checked += estimate.world_from_body.translation.squaredNorm();
  }
  stop = true;
  if (!std::isfinite(checked))
    return fail(Errc::kBadFormat, "timing queries: a pose is not finite");

  const double clock_p50 = quantile(clock_ns, 0.5);
  const double p50 = quantile(query_ns, 0.5);
  const double p99 = quantile(query_ns, 0.99);
  const double most = *std::ranges::max_element(query_ns);
  line.print(
      {{"queries", kQueries},
       {"tracker_hz", kTracker_hz},
       {"query_ns_p50", p50},
       {"query_ns_p99", p99},
       {"query_ns_max", most},
       {"clock_ns_p50", clock_p50}},
      fmt::format("{} queries beside {} samples a second: {:.0f} ns (p99 {:.0f}, worst {:.0f}), "
                  "of which a look at the clock takes {:.0f}",
                  kQueries,
                  kTracker_hz,
                  p50,
                  p99,
                  most,
                  clock_p50));
  return kExitDone;
}

}  // namespace veneer::cli
