// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libudev.h>

#include <memory>
#include <optional>

#include "tracking/transports/bus_device.h"

namespace veneer::tracking {

struct UdevUnref {
  void operator()(udev* p) const { udev_unref(p); }
  void operator()(udev_enumerate* p) const { udev_enumerate_unref(p); }
  void operator()(udev_device* p) const { udev_device_unref(p); }
  void operator()(udev_monitor* p) const { udev_monitor_unref(p); }
};
template <class T>
using UdevPtr = std::unique_ptr<T, UdevUnref>;

[[nodiscard]] constexpr const char* subsystem_of(DeviceClass device_class) {
  return device_class == DeviceClass::kUsb ? "usb" : "hidraw";
}
/// What udev knows of a device; nothing where it is no device of ours (a hub's interface, a
/// Bluetooth keyboard) or has gone meanwhile.
[[nodiscard]] std::optional<BusDevice> read_device(udev_device* device, DeviceClass device_class);

}  // namespace veneer::tracking
