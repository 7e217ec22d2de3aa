// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/tracker.h"
#include "tracking/usb_devices.h"

namespace veneer::tracking {

/// Keys: serial, usb_port, position_m, and those of DeviceTrackerOptions.
/// @param clock  borrowed; must outlive the tracker.
[[nodiscard]] Result<std::unique_ptr<Tracker>> open_osvr_hdk(TomlReader& config, Clock& clock);
/// How it shows on USB.
[[nodiscard]] std::vector<UsbAppearance> osvr_hdk_on_usb();

}  // namespace veneer::tracking
