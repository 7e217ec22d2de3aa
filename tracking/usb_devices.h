// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tracking/transports/bus_device.h"

namespace veneer::tracking {

/// How a tracker shows on USB.
struct UsbAppearance {
  std::string model;  ///< for people
  UsbId id;
  DeviceClass device_class = DeviceClass::kUsb;  ///< through which its driver opens it
  bool needs_firmware = false;  ///< it runs its boot loader and waits to be given one
};

/// A tracker that is plugged in.
struct UsbDevice {
  std::string_view driver;  ///< that is meant for it
  std::string model;
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial;  ///< may be empty
  std::string port;    ///< such as "1-2.4"
  DeviceClass device_class = DeviceClass::kUsb;
  bool needs_firmware = false;
};

/// The trackers that Veneer knows among the devices on USB, sorted by port. Opens none of them, so
/// that it works without permission and while another program holds them.
/// @param sysfs  where the system lists USB devices.
[[nodiscard]] std::vector<UsbDevice> usb_devices(
    const std::filesystem::path& sysfs = "/sys/bus/usb/devices");

}  // namespace veneer::tracking
