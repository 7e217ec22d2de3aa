// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "tracking/device/transport.h"
#include "tracking/transports/bus_device.h"
#include "tracking/transports/hotplug.h"

namespace veneer::tracking {

/// What makes up a HID device that a driver wants.
struct HidModel {
  std::vector<UsbId> ids;  ///< under any of which it may show
  int interface = 0;       ///< whose reports are read
  /// Where feature reports go, if not to the same one.
  std::optional<int> control_interface;
  std::string udev_rule{kTrackersUdevRule};  ///< that gives permission to open it, for texts
};

/// A HID device, over hidapi: reports come in whole, feature reports go out.
class HidPort final : public Port {
 public:
  /// @param name  of the device, for texts.
  /// @param clock  borrowed; must outlive the port and what it opens.
  HidPort(std::string name, HidModel model, UsbIdentity identity, Clock& clock);

  [[nodiscard]] std::string description() const override;
  [[nodiscard]] Result<std::unique_ptr<Transport>> open() override;
  [[nodiscard]] bool wait_for_arrival(Time deadline) override {
    return hotplug_.wait_for_arrival(deadline);
  }

 private:
  [[nodiscard]] bool is_wanted(const BusDevice& device, int interface) const;

  std::string name_;
  HidModel model_;
  UsbIdentity identity_;
  std::optional<UsbId> opened_;
  Clock& clock_;
  HotplugMonitor hotplug_;
};

}  // namespace veneer::tracking
