// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/clock.h"

namespace veneer::tracking {

/// Both clocks of the system at one moment.
struct ClockPair {
  Time monotonic;
  Duration realtime{};  ///< since 1970; may jump when somebody sets the clock

  [[nodiscard]] static ClockPair now();
};

/// Brings the kernel's arrival stamps, which are on the wall clock, to CLOCK_MONOTONIC.
///
/// How old a stamp is, both clocks tell when they are read together. A wall clock that was set
/// between the arrival and that reading makes the age wrong by as much; such an age is noticed when
/// it is negative or reaches back beyond the moment at which the queue was last seen to be empty,
/// and then the arrival is taken to be the reading: late by no more than the datagram has waited.
class ArrivalStamp {
 public:
  /// @param opened  when the socket was made.
  explicit ArrivalStamp(Time opened) : earliest_(opened) {}
  /// The queue was empty at `when`, so that all that follows arrived later.
  void queue_was_empty(Time when) { earliest_ = when; }
  /// @param kernel_stamp  on the wall clock, as SO_TIMESTAMPNS gives it.
  /// @param now           read after the datagram was taken from the queue.
  /// @return  never after `now`, never before the stamp returned last.
  [[nodiscard]] Time arrival(Duration kernel_stamp, const ClockPair& now);

 private:
  Time earliest_;  // that the next datagram can have arrived
};

}  // namespace veneer::tracking
