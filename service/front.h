// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>

#include "service/control.h"

namespace veneer::service {

/// The table [service] of the configuration, and what main() adds.
struct FrontOptions {
  /// "none", "system", "session" or a D-Bus address.
  std::string bus = "none";
  int metrics_port = 0;                ///< on 127.0.0.1; 0: none
  std::filesystem::path metrics_file;  ///< absolute, NAME.prom; empty: none
  /// Borrowed, may be null: whoever sets it (a handler of SIGHUP) has the configuration reloaded;
  /// it is then false again.
  std::atomic<bool>* reload_requested = nullptr;

  /// Errors: kInvalidOption (says which key).
  [[nodiscard]] Status check() const;
};

/// All that the rest of the machine sees of veneerd: the bus, systemd, metrics. What cannot be had
/// is a warning in the log, never an end: the picture matters more.
class Front {
 public:
  /// @param control  borrowed; must outlive the front.
  [[nodiscard]] static std::unique_ptr<Front> start(ServiceControl& control,
                                                    const FrontOptions& options);
  /// Tells systemd that it stops, then lets go of everything. Up to ten seconds where a command is
  /// being done.
  virtual ~Front() = default;
};

}  // namespace veneer::service
