// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "tracking/device/transport.h"
#include "tracking/transports/bus_device.h"
#include "tracking/transports/hotplug.h"

namespace veneer::tracking {

/// An endpoint that is read.
struct UsbPipe {
  enum class Kind { kNone, kBulk, kInterrupt };
  std::uint8_t endpoint = 0;
  Kind kind = Kind::kNone;
};

/// One line of the table of the devices that a port accepts.
struct UsbModel {
  std::string_view name;  ///< for people
  UsbId id;
  /// The product number under which it shows before its firmware is loaded; 0 where it needs none.
  std::uint16_t boot_product = 0;
  /// The bulk endpoint that is written and those that are read; where they are left out, those that
  /// interface 0 describes.
  std::uint8_t out = 0;
  std::array<UsbPipe, 2> in{};
};

/// A device on USB, over libusb: bulk or interrupt transfers on interface 0.
class UsbBulkPort final : public Port {
 public:
  /// @param name  of the device, for texts.
  /// @param clock  borrowed; must outlive the port and what it opens.
  UsbBulkPort(std::string name, std::vector<UsbModel> models, UsbIdentity identity, Clock& clock);

  [[nodiscard]] std::string description() const override;
  [[nodiscard]] Result<std::unique_ptr<Transport>> open() override;
  [[nodiscard]] bool wait_for_arrival(Time deadline) override {
    return hotplug_.wait_for_arrival(deadline);
  }

 private:
  [[nodiscard]] const UsbModel* model_of(UsbId id) const;
  [[nodiscard]] const UsbModel* model_without_firmware(UsbId id) const;

  std::string name_;
  std::vector<UsbModel> models_;
  UsbIdentity identity_;
  std::optional<UsbId> opened_;
  Clock& clock_;
  HotplugMonitor hotplug_;
};

}  // namespace veneer::tracking
