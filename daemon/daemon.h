// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "daemon/devices.h"
#include "daemon/summary.h"
#include "service/control.h"

namespace veneer::daemon {

/// veneerd without its main(): everything that one configuration names, kept running whatever
/// happens to it.
class Daemon : public service::ServiceControl {
 public:
  /// Reads the configuration. Nothing is opened yet.
  /// @param settings  "key = value" lines that replace what the file says.
  /// @param devices   as the configuration says where a member is empty.
  [[nodiscard]] static Result<std::unique_ptr<Daemon>> create(
      const std::filesystem::path& config_path,
      const std::vector<std::string>& settings,
      Devices devices = {});
  /// Opens it all and makes frames until Config::frames are made or `stop` becomes true; then
  /// writes the summary and frame log that the configuration asks for. The calling thread draws.
  /// Errors: those of every part where it fails before the first frame.
  [[nodiscard]] virtual Result<Summary> run(const std::atomic<bool>& stop, Progress& progress) = 0;
};

/// Opens all that the configuration names, runs the frame loop until its end or until `stop`, and
/// writes the summary and frame log that it asks for.
/// In real time, a profile that takes the place of the configured one is drawn with from the next
/// frame on (ProfileWatcher). One that is damaged at the start is replaced by the newest good one
/// of its history (ProfileStore), with a warning.
/// @param settings  "key = value" lines that replace what the file says.
/// @param check_profile  borrowed, may be null: see ProfileWatcher.
/// Errors: those of every part; nothing has been shown if it fails before the first frame.
[[nodiscard]] Result<Summary> run(const std::filesystem::path& config_path,
                                  const std::vector<std::string>& settings,
                                  const std::atomic<bool>& stop,
                                  Progress& progress,
                                  std::atomic<bool>* check_profile = nullptr);

}  // namespace veneer::daemon
