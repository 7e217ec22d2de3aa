// SPDX-License-Identifier: Apache-2.0
#include "tracking/status.h"

namespace veneer::tracking {

std::string_view name_of(TrackerState state) {
  switch (state) {
    case TrackerState::kAbsent:
      return "absent";
    case TrackerState::kFailed:
      return "failed";
    case TrackerState::kInitialising:
      return "initialising";
    case TrackerState::kSyncing:
      return "syncing";
    case TrackerState::kClockLocking:
      return "clock locking";
    case TrackerState::kTracking:
      return "tracking";
    case TrackerState::kSilent:
      return "silent";
  }
  return "unknown";
}

}  // namespace veneer::tracking
