// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "base/result.h"
#include "capture/internal_plan_json.h"
#include "capture/recording.h"

namespace veneer::capture {

/// By what a file is known again.
struct FileMark {
  std::uint64_t bytes = 0;
  std::string checksum;
};

/// What the lines of a session's journal say.
struct Journal {
  std::map<Shot, FileMark> pictures;
  std::map<std::string, std::string> notes;  ///< JSON
  /// False where the line is none of ours.
  bool take_line(std::string_view line);
  /// See take_lines().
  [[nodiscard]] Result<std::size_t> take(std::string_view text);
};

}  // namespace veneer::capture
