// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// Keys: model, serial, usb_port, and those of DeviceTrackerOptions.
/// @param clock  borrowed; must outlive the tracker.
[[nodiscard]] Result<std::unique_ptr<Tracker>> open_polhemus(TomlReader& config, Clock& clock);

}  // namespace veneer::tracking
