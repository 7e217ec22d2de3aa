// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/machine_load.h"

#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <string>
#include <thread>

namespace veneer::soak {
namespace {

constexpr auto kInterval = std::chrono::milliseconds(500);
/// Of all processors. The kernel's own work and an idle desktop take a few hundredths.
constexpr double kBusy = 0.1;

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

}  // namespace

std::optional<MachineLoad::Look> MachineLoad::look() {
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
  return Look{std::chrono::steady_clock::now(),
              all / static_cast<double>(::sysconf(_SC_CLK_TCK)),
              seconds(usage.ru_utime) + seconds(usage.ru_stime)};
}

bool MachineLoad::busy() {
  if (last_ && std::chrono::steady_clock::now() - last_->time < kInterval) return busy_;
  const std::optional<Look> now = look();
  if (now && last_) {
    const double others = (now->all_s - last_->all_s) - (now->ours_s - last_->ours_s);
    const double had = std::chrono::duration<double>(now->time - last_->time).count() *
                       std::thread::hardware_concurrency();
    busy_ = others > kBusy * had;
  }
  last_ = now;
  return busy_;
}

}  // namespace veneer::soak
