// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>

#include "base/clock.h"

namespace veneer::tracking {

/// What poll() wants to be told: whole milliseconds, rounded up, lest the last fraction of one be
/// spent spinning; a minute at most.
[[nodiscard]] inline int poll_milliseconds(Duration left) {
  using std::chrono::milliseconds;
  const auto rounded = std::chrono::ceil<milliseconds>(left);
  return static_cast<int>(
      std::clamp(rounded, milliseconds(0), milliseconds(std::chrono::minutes(1))).count());
}

}  // namespace veneer::tracking
