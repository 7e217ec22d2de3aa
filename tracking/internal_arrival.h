// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/clock.h"
#include "base/result.h"

namespace veneer::tracking {

/// Sleeps until `arrival`, but for at most `timeout`. For drivers whose samples come at known
/// times. Errors: kTimeout, with a text short enough to need no allocation (a frame loop meets it
/// often).
[[nodiscard]] inline Status wait_for_arrival(Clock& clock, Time arrival, Duration timeout) {
  const Time now = clock.now();
  if (arrival <= now) return {};
  if (arrival - now > timeout) {
    clock.sleep_until(now + timeout);
    return tl::unexpected<Error>(Error{Errc::kTimeout, "no pose in time"});
  }
  clock.sleep_until(arrival);
  return {};
}

}  // namespace veneer::tracking
