// SPDX-License-Identifier: Apache-2.0
#include "tracking/usb_access.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/files.h"
#include "tracking/transports/bus_device.h"

namespace veneer::tracking {
namespace {

namespace fs = std::filesystem;

/// What a folder holds, sorted; nothing where it is not there or may not be read.
std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> result;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    result.push_back(entry->path());
  }
  std::ranges::sort(result);
  return result;
}

std::optional<int> number_in(std::string_view text) {
  while (text.ends_with('\n')) text.remove_suffix(1);
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// The files below /dev that its driver would open.
std::vector<fs::path> nodes_of(const UsbDevice& device, const SystemFolders& folders) {
  const fs::path folder = folders.usb / device.port;
  if (device.device_class == DeviceClass::kUsb) {
    const auto bus = number_in(read_text(folder / "busnum").value_or(""));
    const auto number = number_in(read_text(folder / "devnum").value_or(""));
    if (!bus || !number) return {};
    return {folders.dev / fmt::format("bus/usb/{:03}/{:03}", *bus, *number)};
  }
  // 1-2/1-2:1.0/0003:1532:0300.0001/hidraw/hidraw0
  std::vector<fs::path> nodes;
  for (const fs::path& interface : entries(folder)) {
    if (!interface.filename().string().starts_with(device.port + ":")) continue;
    for (const fs::path& hid : entries(interface))
      for (const fs::path& node : entries(hid / "hidraw"))
        nodes.push_back(folders.dev / node.filename());
  }
  return nodes;
}

/// "veneerd (process 4711)" of the first other program that has `node` open.
std::optional<std::string> holder_of(const fs::path& node, const fs::path& proc) {
  for (const fs::path& process : entries(proc)) {
    const std::string id = process.filename().string();
    if (const auto number = number_in(id); !number || *number == ::getpid()) continue;
    for (const fs::path& descriptor : entries(process / "fd")) {
      std::error_code error;
      if (fs::read_symlink(descriptor, error) != node || error) continue;
      std::string name = read_text(process / "comm").value_or("a program");
      while (name.ends_with('\n')) name.pop_back();
      return fmt::format("{} (process {})", name, id);
    }
  }
  return std::nullopt;
}

}  // namespace

Status check_access(const UsbDevice& device, const SystemFolders& folders) {
  const BusDevice bus_device{
      {device.vendor, device.product}, device.serial, device.port, 0, std::string()};
  if (device.needs_firmware) return tl::unexpected<Error>(firmware_error(device.model, bus_device));
  const std::vector<fs::path> nodes = nodes_of(device, folders);
  if (nodes.empty()) {
    return fail(
        Errc::kNotFound,
        "opening {} on usb port {}: the system has made no file for it below /dev; see "
        "that udev runs{}, and plug it out and in again",
        device.model,
        device.port,
        device.device_class == DeviceClass::kHidraw ? " and that hidraw is in the kernel" : "");
  }
  for (const fs::path& node : nodes) {
    BusDevice opened = bus_device;
    opened.node = node.string();
    if (::access(node.c_str(), R_OK | W_OK) != 0)
      return tl::unexpected<Error>(open_error(device.model, opened, errno));
    // Several may have a HID device open; a transfer interface belongs to one.
    if (device.device_class == DeviceClass::kHidraw) continue;
    if (const auto holder = holder_of(node, folders.proc)) {
      return fail(Errc::kUnavailable,
                  "opening {} with {} ({}): {} holds it; stop that one first",
                  device.model,
                  identity_text(opened),
                  opened.node,
                  *holder);
    }
  }
  return {};
}

}  // namespace veneer::tracking
