// SPDX-License-Identifier: Apache-2.0
#include "base/clock.h"

#include <ctime>
#include <thread>

namespace veneer {

Time SteadyClock::now() const { return std::chrono::steady_clock::now(); }

void SteadyClock::sleep_until(Time wake) { std::this_thread::sleep_until(wake); }

void VirtualClock::sleep_until(Time wake) {
  const Duration::rep wake_ns = wake.time_since_epoch().count();
  if (wake_ns > now_.load()) now_.store(wake_ns);
}

Duration time_asleep() {
  timespec boot{};
  timespec running{};
  ::clock_gettime(CLOCK_BOOTTIME, &boot);
  ::clock_gettime(CLOCK_MONOTONIC, &running);
  return std::chrono::seconds(boot.tv_sec - running.tv_sec) +
         std::chrono::nanoseconds(boot.tv_nsec - running.tv_nsec);
}

}  // namespace veneer
