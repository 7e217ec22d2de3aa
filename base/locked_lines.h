// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "base/unique_handle.h"

namespace veneer {

/// Takes the lines of a journal's text one by one.
/// @param take  false: this line is not understood. After a power loss the last line may be cut off
///   or have its length but not its bytes: then it ends there, without an error.
/// Returns the number of bytes that were understood.
/// Errors: kBadFormat (a line before the last that is not understood; says at which byte), those
/// of `take`.
[[nodiscard]] Result<std::size_t> take_lines(
    std::string_view text, const std::function<Result<bool>(std::string_view line)>& take);

/// A file of lines that one program at a time adds to, each line on the disk before anybody goes
/// on: the base of journals, which a program that was killed goes on with. One thread.
class LockedLines {
 public:
  /// Opens or makes the file and locks it. Errors: kUnavailable (another program has it open), kIo.
  [[nodiscard]] static Result<LockedLines> open(const std::filesystem::path& path);
  /// Hands every line to `take` and cuts off what an interruption left at the end.
  /// Errors: those of take_lines(), kIo.
  [[nodiscard]] Status take(const std::function<Result<bool>(std::string_view line)>& take);
  /// Written and flushed to the disk on return; on an error nothing of it counts.
  /// @param line  without its end. Errors: kIo (disk full, for example).
  [[nodiscard]] Status append(std::string_view line);
  /// Forgets all lines. Errors: kIo.
  [[nodiscard]] Status clear();

 private:
  LockedLines(std::filesystem::path path, UniqueFd fd)
      : path_(std::move(path)), fd_(std::move(fd)) {}
  std::filesystem::path path_;
  UniqueFd fd_;  // locked; empty once a line could not be taken back
};

}  // namespace veneer
