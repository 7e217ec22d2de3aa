// SPDX-License-Identifier: Apache-2.0
#include "tracking/usb_devices.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <optional>
#include <system_error>

#include "tracking/drivers.h"

namespace veneer::tracking {
namespace {

namespace fs = std::filesystem;

/// The first line of a file; empty where there is none.
std::string line_of(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::optional<std::uint16_t> number_of(const fs::path& path) {
  const std::string line = line_of(path);
  std::uint16_t value = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), value, 16);
  if (error != std::errc{} || end == line.data()) return std::nullopt;
  return value;
}

}  // namespace

std::vector<UsbDevice> usb_devices(const fs::path& sysfs) {
  std::vector<UsbDevice> devices;
  std::error_code error;  // a machine without USB has no such folder
  for (fs::directory_iterator entry(sysfs, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path folder = entry->path();
    const auto vendor = number_of(folder / "idVendor");
    const auto product = number_of(folder / "idProduct");
    if (!vendor || !product) continue;
    for (const Driver& driver : drivers()) {
      const std::vector<UsbAppearance> known =
          driver.on_usb != nullptr ? driver.on_usb() : std::vector<UsbAppearance>{};
      const auto found = std::ranges::find(known, UsbId{*vendor, *product}, &UsbAppearance::id);
      if (found == known.end()) continue;
      devices.push_back({driver.name,
                         found->model,
                         *vendor,
                         *product,
                         line_of(folder / "serial"),
                         folder.filename().string(),
                         found->device_class,
                         found->needs_firmware});
    }
  }
  std::ranges::sort(devices, {}, &UsbDevice::port);
  return devices;
}

}  // namespace veneer::tracking
