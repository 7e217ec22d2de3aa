// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "base/result.h"
#include "base/toml_reader.h"
#include "projector/output.h"

namespace veneer::projector {

/// One line of the registry of outputs.
struct OutputDriver {
  std::string_view name;
  std::string_view summary;
  /// @param config  the [output] table; the driver reads its own keys, the caller calls finish().
  Result<std::unique_ptr<Output>> (*open)(TomlReader& config);
};

/// Every output, sorted by name: "file" (PNG of the drive codes, 8 or 16 bits, and EXR of the
/// target if asked for; written by a thread of its own), "null", "window".
[[nodiscard]] std::span<const OutputDriver> output_drivers();
/// Opens the output that the key `driver` of the table names.
[[nodiscard]] Result<std::unique_ptr<Output>> open_output(TomlReader& config);

}  // namespace veneer::projector
