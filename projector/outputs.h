// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
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
  /// @param state_directory  as open_output().
  Result<std::unique_ptr<Output>> (*open)(TomlReader& config,
                                          const std::filesystem::path& state_directory);
};

/// Every output, sorted by name.
[[nodiscard]] std::span<const OutputDriver> output_drivers();
/// Opens the output that the key `driver` of the table names.
/// @param state_directory  where a driver keeps what is to outlive it, unless its own table says
///                         another; empty: the driver's own choice.
[[nodiscard]] Result<std::unique_ptr<Output>> open_output(
    TomlReader& config, const std::filesystem::path& state_directory = {});

}  // namespace veneer::projector
