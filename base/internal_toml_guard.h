// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

namespace veneer {

/// Where a text has what toml++ 3.3 takes to be impossible, so that its behaviour is undefined.
struct ImpossibleToml {
  std::size_t at;
  const char* what;
};
/// None in all that toml++ can take, or refuses by itself. What it finds: a character beyond ASCII
/// outside of strings and comments, where TOML has none (most of them are too much for
/// is_non_ascii_horizontal_whitespace), a header that begins with no name (parse_key), or a brace
/// in the place of a value (parse_value).
[[nodiscard]] std::optional<ImpossibleToml> find_impossible_toml(std::string_view text);

}  // namespace veneer
