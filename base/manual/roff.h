// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/manual/usage.h"

namespace veneer::manual {

/// A manual page but for what the usage says.
struct Page {
  std::string name;  ///< "veneer-fit"
  int section = 1;   ///< 1: commands, 8: services
  /// Title and text of sections after the options. Paragraphs are parted by an empty line; a
  /// paragraph "term: text" of which the term begins with * is set as a term of a list, without the
  /// star.
  std::vector<std::pair<std::string, std::string>> sections;
  std::vector<std::string> see_also;  ///< "veneerd(8)"
};

/// Text as roff shows it unchanged: no character of it is taken for a request or an escape.
[[nodiscard]] std::string escape_roff(std::string_view text);

/// The page in roff (man macros), whole. It bears the project's version and no date, so that it is
/// the same wherever and whenever it is made.
[[nodiscard]] std::string to_roff(const Usage& usage, const Page& page);

}  // namespace veneer::manual
