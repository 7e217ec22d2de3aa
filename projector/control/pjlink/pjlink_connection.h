// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/clock.h"
#include "base/result.h"
#include "base/unique_handle.h"

namespace veneer::projector::pjlink {

/// Lines over TCP, every wait bounded. Deadlines are on CLOCK_MONOTONIC.
class Connection {
 public:
  /// Errors: kNotFound (no such name, nobody listens, no way there, no answer), kIo.
  [[nodiscard]] static Result<Connection> open(const std::string& host, int port, Time deadline);
  /// Errors: kTimeout, kDisconnected, kIo; all final.
  [[nodiscard]] Status write(std::string_view bytes, Time deadline);
  /// The next line, without its CR (nor the LF that some devices add to it). Errors: kTimeout and
  /// kDisconnected (both also for a line that was begun), kBadFormat (one too long), kIo; all
  /// final.
  [[nodiscard]] Result<std::string> read_line(Time deadline);
  /// Whether something came that no read_line() has returned: an answer that nobody waits for any
  /// more, or the end of the connection.
  [[nodiscard]] bool has_news() const;

 private:
  Connection(UniqueFd socket, std::string name)
      : socket_(std::move(socket)), name_(std::move(name)) {}
  UniqueFd socket_;
  std::string name_;  // "TCP host:port", for texts
  std::string received_;
};

}  // namespace veneer::projector::pjlink
