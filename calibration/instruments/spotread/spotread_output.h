// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "base/colour.h"

namespace veneer::calibration::spotread {

/// What ArgyllCMS `spotread` has come to.
struct Event {
  enum class Kind {
    kReady,         ///< it waits for a key to take a reading
    kResult,        ///< `xyz`, cd/m^2
    kAction,        ///< it waits for a person to do `text`, and then for a key
    kRetry,         ///< something failed, `text`; it waits for a key to try again
    kSavedReading,  ///< the instrument holds readings of before; it waits for a key to use them
    kFatal,         ///< `text`; it will end
  };
  Kind kind = Kind::kReady;
  Xyz xyz = Xyz::Zero();
  std::string text;  ///< printable, on one line
};

/// Makes events of what the program prints, however it arrives in pieces. Prompts do not end with a
/// line, so they are known as soon as their last character is there.
class Output {
 public:
  /// Of a text without a line's end, what goes beyond this is thrown away.
  static constexpr std::size_t kLongestLine = 4096;

  void feed(std::string_view bytes);
  /// The next event; empty until more is fed.
  [[nodiscard]] std::optional<Event> next();
  /// What it complained of since the last prompt or result, and what it said last: for texts when
  /// it ends or hangs. Printable, may be empty.
  [[nodiscard]] std::string complaint() const;

 private:
  [[nodiscard]] std::optional<Event> take_line(std::string_view line);
  [[nodiscard]] std::optional<Event> take_prompt(std::string_view line);
  void forget();

  std::string pending_;    // not looked at yet
  std::string said_;       // lines since the last prompt or result, joined
  std::string complaint_;  // those of them that are complaints
};

}  // namespace veneer::calibration::spotread
