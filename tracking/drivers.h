// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/tracker.h"
#include "tracking/usb_devices.h"

namespace veneer::tracking {

/// One line of the registry of tracker drivers.
struct Driver {
  std::string_view name;
  std::string_view summary;
  /// @param config  the [tracker] table; the driver reads its own keys, the caller calls finish().
  /// @param clock   borrowed; must outlive the tracker.
  /// Errors: kNotFound, kBadFormat, kInvalidOption.
  Result<std::unique_ptr<Tracker>> (*open)(TomlReader& config, Clock& clock);
  /// How the devices of this driver show on USB; null where it has none there.
  std::vector<UsbAppearance> (*on_usb)() = nullptr;
};

/// Every driver, sorted by name.
[[nodiscard]] std::span<const Driver> drivers();
/// Opens the driver that the key `driver` of the table names.
[[nodiscard]] Result<std::unique_ptr<Tracker>> open_tracker(TomlReader& config, Clock& clock);

}  // namespace veneer::tracking
