// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <string>

#include "base/internal_toml_guard.h"

namespace veneer {
namespace {

/// The end of the string that begins at `begin` with a quote of either kind.
std::size_t end_of_string(std::string_view text, std::size_t begin) {
  const char quote = text[begin];
  const std::string triple(3, quote);
  const bool long_one = text.substr(begin, 3) == triple;
  std::size_t i = begin + (long_one ? 3 : 1);
  while (i < text.size()) {
    if (text[i] == '\\' && quote == '"') {
      i += 2;
    } else if (long_one && text.substr(i, 3) == triple) {
      i += 3;
      // Up to two more of them are its contents.
      for (int more = 0; more < 2 && i < text.size() && text[i] == quote; ++more) ++i;
      return i;
    } else if (!long_one && (text[i] == quote || text[i] == '\n')) {
      return i + 1;
    } else {
      ++i;
    }
  }
  return text.size();
}

/// Whether a table's header, which begins with its bracket, goes on as toml++ can take: with a
/// name, or with what it refuses itself.
bool goes_on_with_a_name(std::string_view header) {
  const auto skip_blanks = [&] {
    header.remove_prefix(std::min(header.find_first_not_of(" \t"), header.size()));
  };
  header.remove_prefix(1);
  skip_blanks();
  if (header.starts_with('[')) {
    header.remove_prefix(1);
    skip_blanks();
  }
  if (header.empty()) return true;
  const auto c = static_cast<unsigned char>(header.front());
  return c >= 0x80 || std::isalnum(c) != 0 ||
         std::string_view("_-\"']").find(header.front()) != std::string_view::npos;
}

/// Whether toml++ takes the quote at `i` for the begin of a string: not within a bare word, as in
/// -"a".
bool may_begin_string(std::string_view text, std::size_t i) {
  return i == 0 || std::string_view(" \t\r\n=,.[{\xBF").find(text[i - 1]) != std::string_view::npos;
}

}  // namespace

std::optional<ImpossibleToml> find_impossible_toml(std::string_view text) {
  std::size_t i = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;  // a byte order mark
  std::string open;                                          // brackets and braces
  bool line_begins = true;
  while (i < text.size()) {
    const char c = text[i];
    if (c == '#') {
      i = std::min(text.find('\n', i), text.size());
    } else if ((c == '"' || c == '\'') && may_begin_string(text, i)) {
      i = end_of_string(text, i);
      line_begins = false;
    } else if (static_cast<unsigned char>(c) >= 0x80) {
      return ImpossibleToml{
          i,
          "a character that is not ASCII stands outside of quotes; put the key or "
          "value in quotes"};
    } else if (c == '[' && line_begins && open.empty() && !goes_on_with_a_name(text.substr(i))) {
      return ImpossibleToml{i, "a table's name should follow the bracket, as in [render]"};
    } else if (c == '}' && open.ends_with('[')) {
      return ImpossibleToml{i, "a brace closes what a bracket has opened"};
    } else {
      if (c == '[' || c == '{') open += c;
      if ((c == ']' || c == '}') && !open.empty()) open.pop_back();
      line_begins = c == '\n' || (line_begins && (c == ' ' || c == '\t'));
      ++i;
    }
  }
  return std::nullopt;
}

}  // namespace veneer
