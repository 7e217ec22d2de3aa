// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "projector/control.h"

namespace veneer::projector {

/// One line of the registry of controls.
struct ControlDriver {
  std::string_view name;
  std::string_view summary;
  /// @param config  the [control] table; the driver reads its own keys, the caller calls finish().
  /// @param clock   borrowed; must outlive the control.
  Result<std::unique_ptr<ProjectorControl>> (*open)(TomlReader& config, Clock& clock);
};

/// Every control, sorted by name: "dlpc350" (TI light engines on USB), "pjlink" (over the network).
[[nodiscard]] std::span<const ControlDriver> control_drivers();
/// Opens the control that the key `driver` of the table names.
[[nodiscard]] Result<std::unique_ptr<ProjectorControl>> open_control(TomlReader& config,
                                                                     Clock& clock);

}  // namespace veneer::projector
