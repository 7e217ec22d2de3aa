// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/clock.h"
#include "base/result.h"
#include "base/unique_handle.h"

namespace veneer::capture {

/// A serial port at 9600 baud, 8N1, on which lines are read. One thread.
class SerialPort {
 public:
  /// Errors: kNotFound, kUnavailable (no permission, another program has it open; says what to do),
  /// kInvalidOption (no serial port), kIo.
  [[nodiscard]] static Result<SerialPort> open(const std::filesystem::path& path);
  /// Forgets what has come so far and sends. Errors: kDisconnected, kTimeout.
  [[nodiscard]] Status send(std::string_view bytes);
  /// The next line, without its end (CR LF or LF). Errors: kTimeout, kDisconnected, kBadFormat (far
  /// too many bytes without an end).
  [[nodiscard]] Result<std::string> read_line(Time deadline);

 private:
  SerialPort(std::filesystem::path path, UniqueFd fd)
      : path_(std::move(path)), fd_(std::move(fd)) {}
  std::filesystem::path path_;
  UniqueFd fd_;
  std::string come_;  // and not read yet
};

}  // namespace veneer::capture
