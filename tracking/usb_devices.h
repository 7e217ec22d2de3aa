// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace veneer::tracking {

/// A tracker that is plugged in.
struct UsbDevice {
  std::string_view driver;  ///< that is meant for it
  std::string_view model;
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial;           ///< may be empty
  std::string port;             ///< such as "1-2.4"
  bool needs_firmware = false;  ///< it runs its boot loader and waits to be given one
};

/// The trackers that Veneer knows among the devices on USB, sorted by port. Opens none of them, so
/// that it works without permission and while another program holds them.
/// @param sysfs  where the system lists USB devices.
[[nodiscard]] std::vector<UsbDevice> usb_devices(
    const std::filesystem::path& sysfs = "/sys/bus/usb/devices");

}  // namespace veneer::tracking
