// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// A simulated LIBERTY (SimulatedPort) behind all that a real one passes through: protocol, clock,
/// and everything that begins again after a fault. Reads the keys of SimulatedDeviceOptions and of
/// DeviceTrackerOptions. Errors: kInvalidOption.
[[nodiscard]] Result<std::unique_ptr<Tracker>> open_simulated_device(TomlReader& config,
                                                                     Clock& clock);

}  // namespace veneer::tracking
