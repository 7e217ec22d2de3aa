// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/toml_reader.h"

namespace veneer::tracking {

/// Gives permission to open trackers.
inline constexpr std::string_view kTrackersUdevRule = "etc/udev/60-veneer-trackers.rules";

/// What the system lists devices under.
enum class DeviceClass { kUsb, kHidraw };

struct UsbId {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  friend bool operator==(const UsbId&, const UsbId&) = default;
};

/// A device that is plugged in, as the system knows it without opening it.
struct BusDevice {
  UsbId id;
  std::string serial;    ///< empty where it has none
  std::string usb_port;  ///< where it is plugged in, "1-2.3": bus, then the sockets of the hubs
  int interface = 0;     ///< of a HID device: which of its USB interfaces
  std::string node;      ///< "/dev/bus/usb/001/005"; another one whenever it is plugged in
};

/// All of them, ordered by port and interface. Errors: kIo.
[[nodiscard]] Result<std::vector<BusDevice>> list_devices(DeviceClass device_class);

/// Which one of several equal devices is meant. Numbers under /dev are no identity: they change
/// with every plug. A device without a serial number is known by the port that it is plugged into.
class UsbIdentity {
 public:
  UsbIdentity() = default;
  /// @param serial, usb_port  empty where they do not matter.
  UsbIdentity(std::string serial, std::string usb_port)
      : serial_(std::move(serial)), usb_port_(std::move(usb_port)) {}
  /// Reads the keys serial and usb_port.
  [[nodiscard]] static UsbIdentity read(TomlReader& toml);

  /// The one that is meant. Once a device was opened, it stays that one: by its serial number
  /// wherever it is plugged in, or without one by its port, or the only one there is if it has
  /// moved.
  /// @param name  of the device, for texts.
  /// @param candidates  of the right kind.
  /// Errors: kNotFound (not there), kInvalidOption (several, and nothing says which).
  [[nodiscard]] Result<BusDevice> choose(const std::string& name,
                                         const std::vector<BusDevice>& candidates) const;
  /// From now on it is this one.
  void remember(const BusDevice& opened) { opened_ = opened; }
  /// "serial number 1234", "usb port 1-2", or nothing.
  [[nodiscard]] std::string text() const;

 private:
  [[nodiscard]] bool fits(const BusDevice& device) const;
  std::string serial_;
  std::string usb_port_;
  std::optional<BusDevice> opened_;
};

/// "1532:0300".
[[nodiscard]] std::string text_of(UsbId id);
/// "serial number 1234", or "usb port 1-2" where it has none.
[[nodiscard]] std::string identity_text(const BusDevice& device);
/// Why a device that is there could not be opened, and what to do; `error` is an errno.
/// @param udev_rule  the file that gives permission, for the text.
[[nodiscard]] Error open_error(const std::string& name,
                               const BusDevice& device,
                               int error,
                               std::string_view udev_rule = kTrackersUdevRule);
/// That it waits for its firmware, and what loads it.
[[nodiscard]] Error firmware_error(const std::string& name, const BusDevice& device);

}  // namespace veneer::tracking
