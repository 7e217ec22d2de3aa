// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/arrival_stamp.h"

#include <algorithm>
#include <ctime>

namespace veneer::tracking {
namespace {

/// The kernel stamps a datagram before it puts it into the queue, so that one may be found a little
/// older than an empty queue.
constexpr Duration kStampToQueue = std::chrono::milliseconds(1);

}  // namespace

ClockPair ClockPair::now() {
  timespec realtime{};
  const Time before = SteadyClock{}.now();
  ::clock_gettime(CLOCK_REALTIME, &realtime);
  const Time after = SteadyClock{}.now();
  return {before + (after - before) / 2,
          std::chrono::seconds(realtime.tv_sec) + std::chrono::nanoseconds(realtime.tv_nsec)};
}

Time ArrivalStamp::arrival(Duration kernel_stamp, const ClockPair& now) {
  const Duration age = now.realtime - kernel_stamp;
  const bool plausible = age >= Duration{0} && age <= now.monotonic - earliest_ + kStampToQueue;
  const Time arrival = plausible ? now.monotonic - age : now.monotonic;
  earliest_ = std::max(arrival, earliest_);
  return earliest_;
}

}  // namespace veneer::tracking
