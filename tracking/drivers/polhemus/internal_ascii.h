// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string_view>

#include "tracking/device/protocol.h"

namespace veneer::tracking {

/// A command as Polhemus devices take them: letters.
[[nodiscard]] inline Command ascii_command(std::string_view text, Duration pause) {
  Command command;
  for (const char c : text) command.bytes.push_back(static_cast<std::byte>(c));
  command.pause = pause;
  return command;
}

/// Readable bytes in a row that belong to no binary frame: the device has reset itself and answers
/// in text.
class TextRun {
 public:
  void add(std::byte skipped) {
    length_ = is_readable(skipped) ? length_ + 1 : 0;
    if (length_ >= kEnough) found_ = true;
  }
  /// A frame ends it.
  void end() { length_ = 0; }
  /// Whether there was one.
  [[nodiscard]] bool found() const { return found_; }

 private:
  /// That no binary frame has by chance: 24 of 97 in 256 are 1 in 10^10.
  static constexpr int kEnough = 24;
  static bool is_readable(std::byte byte) {
    const auto c = std::to_integer<unsigned char>(byte);
    return (c >= 0x20 && c < 0x7F) || c == '\r' || c == '\n';
  }
  int length_ = 0;
  bool found_ = false;
};

}  // namespace veneer::tracking
