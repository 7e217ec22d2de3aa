// SPDX-License-Identifier: Apache-2.0
#include "base/clock.h"

#include <thread>

namespace veneer {

Time SteadyClock::now() const { return std::chrono::steady_clock::now(); }

void SteadyClock::sleep_until(Time wake) { std::this_thread::sleep_until(wake); }

void VirtualClock::sleep_until(Time wake) {
  const Duration::rep wake_ns = wake.time_since_epoch().count();
  if (wake_ns > now_.load()) now_.store(wake_ns);
}

}  // namespace veneer
