// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace veneer::tracking {

/// What a tracker is doing, in the order in which a device goes through it.
enum class TrackerState {
  kAbsent,        ///< not plugged in, or nobody answers; looked for again and again
  kFailed,        ///< there, but it cannot be opened: the detail says why and what to do
  kInitialising,  ///< being told what to send
  kSyncing,       ///< the first whole frame is waited for
  kClockLocking,  ///< its clock is being matched to ours; poses are usable, velocities are not
  kTracking,
  kSilent,  ///< it has stopped sending; it is told again, then opened again
};

[[nodiscard]] std::string_view name_of(TrackerState state);

/// What a tracker has seen since it was made. All of them only grow.
struct TrackerCounters {
  std::uint64_t samples = 0;        ///< handed out
  std::uint64_t lost = 0;           ///< missing by their sequence numbers
  std::uint64_t duplicates = 0;     ///< of a sample that was there already; dropped
  std::uint64_t late = 0;           ///< measured before one that was there already; dropped
  std::uint64_t suspect = 0;        ///< marked as unsure by the device; dropped
  std::uint64_t skipped_bytes = 0;  ///< that belong to no frame
  std::uint64_t bad_frames = 0;     ///< of a wrong size, checksum, station or version
  std::uint64_t clock_outliers =
      0;  ///< samples whose device time does not fit their arrival; dropped
  std::uint64_t clock_restarts = 0;
  std::uint64_t io_errors = 0;
  std::uint64_t restarts = 0;     ///< told again what to send
  std::uint64_t opened = 0;       ///< successful openings; one more than replugs
  std::uint64_t open_errors = 0;  ///< attempts that failed

  friend bool operator==(const TrackerCounters&, const TrackerCounters&) = default;
};

struct TrackerStatus {
  TrackerState state = TrackerState::kTracking;
  /// For people: which device, what is wrong with it and what to do. May be empty.
  std::string detail;
  TrackerCounters counters;
};

}  // namespace veneer::tracking
