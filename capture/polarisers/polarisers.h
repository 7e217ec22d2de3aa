// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "base/result.h"
#include "base/toml_reader.h"
#include "capture/hands.h"
#include "capture/polariser.h"

namespace veneer::capture {

/// One line of the registry of polarisers.
struct PolariserDriver {
  std::string_view name;
  std::string_view summary;
  /// @param config  the [polariser] table; the driver reads its own keys, the caller calls
  /// finish().
  /// @param hands  borrowed; must outlive the polariser.
  Result<std::unique_ptr<Polariser>> (*open)(TomlReader& config, Hands& hands);
};

/// Every driver, sorted by name: "elliptec" (Thorlabs ELL14 and kin, over a serial port), "hand" (a
/// person turns it).
[[nodiscard]] std::span<const PolariserDriver> polariser_drivers();
/// Opens the one that the key `driver` of the table names; "hand" where there is none.
[[nodiscard]] Result<std::unique_ptr<Polariser>> open_polariser(TomlReader& config, Hands& hands);

}  // namespace veneer::capture
