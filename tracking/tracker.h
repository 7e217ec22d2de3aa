// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>

#include "base/result.h"
#include "tracking/pose.h"
#include "tracking/status.h"

namespace veneer::tracking {

/// The tracker HAL: a source of pose samples. One thread uses it at a time.
class Tracker {
 public:
  virtual ~Tracker() = default;
  /// For logs: driver and device.
  [[nodiscard]] virtual std::string description() const = 0;
  /// The next sample, in the order of arrival. Blocks for at most `timeout` on the tracker's clock;
  /// while a device is opened or told something, for some tenths of a second more. A device that
  /// was unplugged is waited for: that is a timeout too, and status() tells. Errors: kTimeout (try
  /// again), kDisconnected (final; open again).
  [[nodiscard]] virtual Result<PoseSample> wait_pose(Duration timeout) = 0;
  /// Whether it ends by itself, as a recording does: kDisconnected is then its end and no fault,
  /// and opening it again would play it again.
  [[nodiscard]] virtual bool ends() const { return false; }
  /// How it is doing. Any thread may ask; it may have to wait for a moment.
  [[nodiscard]] virtual TrackerStatus status() const { return {}; }
};

}  // namespace veneer::tracking
