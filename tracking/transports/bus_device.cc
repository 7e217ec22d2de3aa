// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/bus_device.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string_view>
#include <tuple>

#include "tracking/transports/internal_udev.h"

namespace veneer::tracking {
namespace {

std::string_view attribute(udev_device* device, const char* name) {
  const char* value = device != nullptr ? udev_device_get_sysattr_value(device, name) : nullptr;
  return value != nullptr ? value : "";
}

std::optional<std::uint16_t> hexadecimal(std::string_view text) {
  std::uint16_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::optional<BusDevice> read_device(udev_device* device, DeviceClass device_class) {
  const char* node = udev_device_get_devnode(device);
  if (node == nullptr) return std::nullopt;
  BusDevice result;
  result.node = node;
  udev_device* usb = device;  // borrowed, as parents are
  if (device_class == DeviceClass::kHidraw) {
    usb = udev_device_get_parent_with_subsystem_devtype(device, "usb", "usb_device");
    udev_device* interface =
        udev_device_get_parent_with_subsystem_devtype(device, "usb", "usb_interface");
    result.interface = hexadecimal(attribute(interface, "bInterfaceNumber")).value_or(0);
  }
  if (usb == nullptr) return std::nullopt;
  const auto vendor = hexadecimal(attribute(usb, "idVendor"));
  const auto product = hexadecimal(attribute(usb, "idProduct"));
  const char* port = udev_device_get_sysname(usb);
  if (!vendor || !product || port == nullptr) return std::nullopt;
  result.id = {*vendor, *product};
  result.usb_port = port;
  result.serial = attribute(usb, "serial");
  return result;
}

Result<std::vector<BusDevice>> list_devices(DeviceClass device_class) {
  const UdevPtr<udev> context(udev_new());
  const UdevPtr<udev_enumerate> list(context ? udev_enumerate_new(context.get()) : nullptr);
  const char* subsystem = subsystem_of(device_class);
  if (!list || udev_enumerate_add_match_subsystem(list.get(), subsystem) < 0 ||
      udev_enumerate_scan_devices(list.get()) < 0) {
    return fail(Errc::kIo,
                "listing the {} devices: udev does not answer; see that /sys is mounted",
                subsystem);
  }
  std::vector<BusDevice> devices;
  for (udev_list_entry* entry = udev_enumerate_get_list_entry(list.get()); entry != nullptr;
       entry = udev_list_entry_get_next(entry)) {
    const UdevPtr<udev_device> device(
        udev_device_new_from_syspath(context.get(), udev_list_entry_get_name(entry)));
    if (!device) continue;  // gone since it was listed
    if (auto read = read_device(device.get(), device_class)) devices.push_back(*std::move(read));
  }
  std::ranges::sort(devices, [](const BusDevice& a, const BusDevice& b) {
    return std::tie(a.usb_port, a.interface) < std::tie(b.usb_port, b.interface);
  });
  return devices;
}

UsbIdentity UsbIdentity::read(TomlReader& toml) {
  UsbIdentity identity;
  toml.read("serial", identity.serial_);
  toml.read("usb_port", identity.usb_port_);
  return identity;
}

bool UsbIdentity::fits(const BusDevice& device) const {
  return (serial_.empty() || device.serial == serial_) &&
         (usb_port_.empty() || device.usb_port == usb_port_) &&
         (!opened_ || (device.id == opened_->id && device.serial == opened_->serial));
}

Result<BusDevice> UsbIdentity::choose(const std::string& name,
                                      const std::vector<BusDevice>& candidates) const {
  std::vector<BusDevice> fitting;
  std::string others;
  for (const BusDevice& device : candidates) {
    if (fits(device)) {
      fitting.push_back(device);
    } else {
      others += fmt::format("{}{}", others.empty() ? "" : " and ", identity_text(device));
    }
  }
  if (opened_) {
    const auto same_port = std::ranges::find(fitting, opened_->usb_port, &BusDevice::usb_port);
    if (same_port != fitting.end()) return *same_port;
  }
  if (fitting.size() == 1) return fitting.front();
  if (fitting.empty() && others.empty()) {
    return fail(Errc::kNotFound,
                "opening {}: it is not there; see that it is plugged in and switched on",
                name);
  }
  if (fitting.empty()) {
    return fail(Errc::kNotFound,
                "opening {}: {} is wanted, but only {} is there; plug in the right one, or change "
                "serial and usb_port and start again",
                name,
                text(),
                others);
  }
  std::string all;
  for (const BusDevice& device : fitting)
    all += fmt::format("{}{}", all.empty() ? "" : ", ", identity_text(device));
  return fail(Errc::kInvalidOption,
              "opening {}: {} of them are there ({}); set serial or usb_port to say which",
              name,
              fitting.size(),
              all);
}

std::string UsbIdentity::text() const {
  if (!serial_.empty()) return fmt::format("serial number {}", serial_);
  if (!usb_port_.empty()) return fmt::format("usb port {}", usb_port_);
  return opened_ ? identity_text(*opened_) : "";
}

std::string text_of(UsbId id) { return fmt::format("{:04x}:{:04x}", id.vendor, id.product); }

std::string identity_text(const BusDevice& device) {
  return device.serial.empty() ? fmt::format("usb port {}", device.usb_port)
                               : fmt::format("serial number {}", device.serial);
}

Error open_error(const std::string& name,
                 const BusDevice& device,
                 int error,
                 std::string_view udev_rule) {
  const std::string doing =
      fmt::format("opening {} with {} ({})", name, identity_text(device), device.node);
  switch (error) {
    case EACCES:
    case EPERM:
      return {Errc::kUnavailable,
              fmt::format("{}: permission denied; copy {} to /etc/udev/rules.d, run \"udevadm "
                          "control --reload\", join the group plugdev, and plug it in again",
                          doing,
                          udev_rule)};
    case EBUSY:
      return {Errc::kUnavailable,
              doing +
                  ": another program holds it; stop that one (another veneerd, a VRPN server, the "
                  "maker's own tools)"};
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return {Errc::kNotFound, doing + ": it was unplugged meanwhile; plug it in again"};
    default:
      return {Errc::kIo,
              fmt::format("{}: {}; plug it out and in again", doing, std::strerror(error))};
  }
}

Error firmware_error(const std::string& name, const BusDevice& device) {
  return {Errc::kUnavailable,
          fmt::format(
              "opening {}: it is there on usb port {} as {}, which means that it needs firmware; "
              "install fxload and the maker's firmware with the udev rule that loads it, then plug "
              "it out and in again (docs/howto/tracker.md)",
              name,
              device.usb_port,
              text_of(device.id))};
}

}  // namespace veneer::tracking
