// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/clock.h"
#include "base/result.h"
#include "base/unique_handle.h"
#include "projector/control/pjlink/name_lookup.h"

namespace veneer::projector::pjlink {

/// Lines over TCP, every wait bounded. Deadlines are on CLOCK_MONOTONIC.
class Connection {
 public:
  /// @param stop  becomes readable when every wait shall end with kCancelled; borrowed, must
  ///              outlive the connection.
  /// @param resolve  for a host that is a name; see look_up().
  /// Errors: kNotFound (no such name, nobody listens, no way there, no answer), kIo, kCancelled,
  /// kUnavailable (the look-up of names hangs).
  [[nodiscard]] static Result<Connection> open(
      const std::string& host, int port, Time deadline, int stop, const Resolve& resolve);
  /// Errors: kTimeout, kDisconnected, kIo, kCancelled; all final.
  [[nodiscard]] Status write(std::string_view bytes, Time deadline);
  /// The next line, without its CR (nor the LF that some devices add to it). Errors: kTimeout and
  /// kDisconnected (both also for a line that was begun), kBadFormat (one too long), kIo,
  /// kCancelled; all final.
  [[nodiscard]] Result<std::string> read_line(Time deadline);
  /// Whether something came that no read_line() has returned: an answer that nobody waits for any
  /// more, or the end of the connection.
  [[nodiscard]] bool has_news() const;

 private:
  Connection(UniqueFd socket, int stop, std::string name)
      : socket_(std::move(socket)), stop_(stop), name_(std::move(name)) {}
  UniqueFd socket_;
  int stop_;
  std::string name_;  // "TCP host:port", for texts
  std::string received_;
};

}  // namespace veneer::projector::pjlink
