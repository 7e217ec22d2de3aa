// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "daemon/summary.h"

namespace veneer::daemon {

/// Opens all that the configuration names, runs the frame loop until its end or until `stop`, and
/// writes the summary and frame log that it asks for.
/// @param settings  "key = value" lines that replace what the file says.
/// Errors: those of every part; nothing has been shown if it fails before the first frame.
[[nodiscard]] Result<Summary> run(const std::filesystem::path& config_path,
                                  const std::vector<std::string>& settings,
                                  const std::atomic<bool>& stop,
                                  Progress& progress);

}  // namespace veneer::daemon
