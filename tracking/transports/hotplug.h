// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "base/clock.h"
#include "tracking/transports/bus_device.h"

namespace veneer::tracking {

/// Hears of devices that are plugged in. One thread uses it at a time.
class HotplugMonitor {
 public:
  using Wanted = std::function<bool(const BusDevice&)>;
  /// Where udev is not running, nothing will ever be heard; waiting still lasts as long as asked.
  /// @param clock  borrowed; must outlive the monitor.
  HotplugMonitor(DeviceClass device_class, Wanted wanted, Clock& clock);
  ~HotplugMonitor();

  /// Forgets what has arrived until now.
  void forget();
  /// Whether a wanted device has arrived since the last question.
  [[nodiscard]] bool arrived();
  /// Waits for that until `deadline`.
  [[nodiscard]] bool wait_for_arrival(Time deadline);

 private:
  struct Monitor;
  DeviceClass device_class_;
  Wanted wanted_;
  Clock& clock_;
  std::unique_ptr<Monitor> monitor_;  // null where there is none
};

}  // namespace veneer::tracking
