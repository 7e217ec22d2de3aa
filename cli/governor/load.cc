// SPDX-License-Identifier: Apache-2.0
#include "cli/governor/load.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <fstream>
#include <string>

#include "base/clock.h"

namespace veneer::cli {
namespace {

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

void keep_busy(const std::stop_token& stop) {
  // Atomic, so that no compiler finds out that nobody wants it.
  std::atomic<std::uint64_t> count{0};
  while (!stop.stop_requested()) count.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

BusyThreads::BusyThreads(std::size_t count) {
  threads_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) threads_.emplace_back(keep_busy);
}

std::optional<OtherPrograms::Look> OtherPrograms::look() {
  std::ifstream file("/proc/stat");
  std::string name;
  // user, nice, system, idle, waiting for disks, interrupts, soft ones, stolen by the host
  std::array<double, 8> ticks{};
  file >> name;
  for (double& one : ticks) file >> one;
  if (!file || name != "cpu") return std::nullopt;
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const double all = ticks[0] + ticks[1] + ticks[2] + ticks[5] + ticks[6] + ticks[7];
  return Look{to_seconds(SteadyClock().now().time_since_epoch()),
              all / static_cast<double>(::sysconf(_SC_CLK_TCK)),
              seconds(usage.ru_utime) + seconds(usage.ru_stime)};
}

std::optional<double> OtherPrograms::share() const {
  const std::optional<Look> now = look();
  if (!now || !begin_ || now->second <= begin_->second) return std::nullopt;
  const double others = (now->all_s - begin_->all_s) - (now->ours_s - begin_->ours_s);
  const double had = (now->second - begin_->second) * std::thread::hardware_concurrency();
  return std::clamp(others / had, 0.0, 1.0);
}

}  // namespace veneer::cli
