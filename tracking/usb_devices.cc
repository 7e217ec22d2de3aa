// SPDX-License-Identifier: Apache-2.0
#include "tracking/usb_devices.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <optional>
#include <system_error>

namespace veneer::tracking {
namespace {

namespace fs = std::filesystem;

struct Known {
  std::uint16_t vendor;
  std::uint16_t product;
  std::string_view driver;
  std::string_view model;
  bool needs_firmware = false;
};

// The boot loaders are those of Polhemus devices whose microcontroller is loaded over USB.
constexpr std::array kKnown{
    Known{0x0f44, 0xff20, "polhemus", "Polhemus LIBERTY (high speed)"},
    Known{0x0f44, 0xff21, "polhemus", "Polhemus LIBERTY (high speed)", true},
    Known{0x0f44, 0xff12, "polhemus", "Polhemus LIBERTY"},
    Known{0x0f44, 0xff11, "polhemus", "Polhemus LIBERTY", true},
    Known{0x0f44, 0xef20, "polhemus", "Polhemus PATRIOT (high speed)"},
    Known{0x0f44, 0xef21, "polhemus", "Polhemus PATRIOT (high speed)", true},
    Known{0x0f44, 0xef12, "polhemus", "Polhemus PATRIOT"},
    Known{0x0f44, 0xef11, "polhemus", "Polhemus PATRIOT", true},
    Known{0x0f44, 0x0002, "polhemus", "Polhemus FASTRAK"},
    Known{0x0f44, 0x0003, "polhemus", "Polhemus FASTRAK"},
    Known{0x0f44, 0x0001, "polhemus", "Polhemus FASTRAK", true},
    Known{0x1532, 0x0300, "razer-hydra", "Razer Hydra"},
    Known{0x1532, 0x0b00, "osvr-hdk", "OSVR HDK"},
    Known{0x03eb, 0x2421, "osvr-hdk", "OSVR HDK"},
};

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
    const auto* known = std::ranges::find_if(kKnown, [&](const Known& each) {
      return each.vendor == vendor && each.product == product;
    });
    if (known == kKnown.end()) continue;
    devices.push_back({known->driver,
                       known->model,
                       known->vendor,
                       known->product,
                       line_of(folder / "serial"),
                       folder.filename().string(),
                       known->needs_firmware});
  }
  std::ranges::sort(devices, {}, &UsbDevice::port);
  return devices;
}

}  // namespace veneer::tracking
