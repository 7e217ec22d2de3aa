// SPDX-License-Identifier: Apache-2.0
#include "cli/picture_size.h"

#include <charconv>

namespace veneer::cli {

Result<PictureSize> parse_size(std::string_view text, int least, int most) {
  PictureSize size;
  const char* const end = text.data() + text.size();
  const auto [middle, first_error] = std::from_chars(text.data(), end, size.width);
  if (first_error == std::errc{} && middle != end && *middle == 'x') {
    const auto [last, error] = std::from_chars(middle + 1, end, size.height);
    const auto is_possible = [&](int side) { return side >= least && side <= most; };
    if (error == std::errc{} && last == end && is_possible(size.width) && is_possible(size.height))
      return size;
  }
  return fail(Errc::kInvalidOption,
              "--size {}: expected WIDTHxHEIGHT, {} to {} each, such as 640x480",
              text,
              least,
              most);
}

}  // namespace veneer::cli
