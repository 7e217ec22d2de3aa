// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/unique_handle.h"

namespace veneer::calibration {

/// A program that runs on a terminal of its own, so that it talks as to a person. It is killed,
/// with all that it started, and waited for when this goes: no zombie stays behind. One thread.
class ChildTerminal {
 public:
  /// @param arguments  the first is the program, looked for in PATH.
  /// @param environment  "NAME=value", in addition to ours.
  /// Errors: kNotFound (no such program), kIo.
  [[nodiscard]] static Result<ChildTerminal> start(const std::vector<std::string>& arguments,
                                                   const std::vector<std::string>& environment);
  ChildTerminal(ChildTerminal&& other) noexcept;
  ChildTerminal& operator=(ChildTerminal&&) = delete;
  ~ChildTerminal();

  /// What it printed; waits for something until `deadline`.
  /// Errors: kTimeout (nothing), kDisconnected (it has ended, all that it printed is read).
  [[nodiscard]] Result<std::string> read(Time deadline, Clock& clock);
  /// Errors: kTimeout (it does not take them; the terminal's buffer is full), kDisconnected.
  [[nodiscard]] Status write(std::string_view keys);
  /// Waits for its end until `deadline`, then ends it. "ended with status 1", "was killed by
  /// signal 11", "had to be killed".
  [[nodiscard]] std::string finish(Time deadline, Clock& clock);
  /// Empty once it was waited for.
  [[nodiscard]] std::optional<pid_t> process() const;

 private:
  ChildTerminal(pid_t process, UniqueFd terminal)
      : process_(process), terminal_(std::move(terminal)) {}
  void kill();
  [[nodiscard]] bool has_ended();

  pid_t process_ = -1;  // -1: waited for
  UniqueFd terminal_;
  int wait_status_ = 0;
};

}  // namespace veneer::calibration
