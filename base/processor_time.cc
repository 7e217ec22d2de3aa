// SPDX-License-Identifier: Apache-2.0
#include "base/processor_time.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string>
#include <thread>

namespace veneer {
namespace {

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

}  // namespace

std::optional<ProcessorTime> processor_time() {
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
  return ProcessorTime{std::chrono::steady_clock::now(),
                       all / static_cast<double>(::sysconf(_SC_CLK_TCK)),
                       seconds(usage.ru_utime) + seconds(usage.ru_stime)};
}

std::optional<double> share_of_others(const ProcessorTime& from, const ProcessorTime& to) {
  if (to.when <= from.when) return std::nullopt;
  const double others = (to.all_s - from.all_s) - (to.ours_s - from.ours_s);
  const double had = std::chrono::duration<double>(to.when - from.when).count() *
                     std::max(1U, std::thread::hardware_concurrency());
  return std::clamp(others / had, 0.0, 1.0);
}

}  // namespace veneer
