// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <string>

#include "base/clock.h"
#include "daemon/config.h"
#include "daemon/faults.h"
#include "daemon/figures.h"

namespace veneer::daemon {

/// What is looked after beside the frame loop, by a thread that may wait: the log's lines of what
/// changed, whether frames come in time, whether the machine has memory left and whether the disk
/// takes what it did not take.
class Housekeeper {
 public:
  /// Borrows the clock, the faults and the board.
  /// @param pressure  as memory_pressure() says it; empty where nobody is to look.
  Housekeeper(Clock& clock,
              ClockKind kind,
              Faults& faults,
              const FigureBoard& board,
              std::function<Result<double>()> pressure);

  /// Does what is due. One thread.
  void look();
  /// Writes the log's lines of what changed: faults, and that the machine slept. One thread.
  void tell();
  /// A file could not be written; its folder is tried until it can. Any thread.
  void disk_failed(const std::filesystem::path& file, const Error& error);
  /// It could.
  void disk_works(const std::filesystem::path& file);

 private:
  void watch_lateness(Time now);
  void watch_memory(Time now);
  void try_disk(Time now);

  Clock& clock_;
  ClockKind kind_;
  Faults& faults_;
  const FigureBoard& board_;
  std::function<Result<double>()> pressure_;
  Time late_due_;
  Time slow_due_;
  Duration slept_{};  // of which it was told
  std::mutex disk_mutex_;
  std::map<std::filesystem::path, std::string> unwritten_;  // and why
};

}  // namespace veneer::daemon
