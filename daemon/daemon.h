// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "daemon/config.h"
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
  /// What the configuration says of who is to speak with it.
  [[nodiscard]] virtual const service::FrontOptions& service_options() const = 0;
};

}  // namespace veneer::daemon
