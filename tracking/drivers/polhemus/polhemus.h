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

/// Keys: model, serial, usb_port, and those of DeviceTrackerOptions.
/// @param clock  borrowed; must outlive the tracker.
[[nodiscard]] Result<std::unique_ptr<Tracker>> open_polhemus(TomlReader& config, Clock& clock);
/// How they show on USB, with and without their firmware.
[[nodiscard]] std::vector<UsbAppearance> polhemus_on_usb();

}  // namespace veneer::tracking
