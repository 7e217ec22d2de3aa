// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace veneer {

/// What a fuzzer feeds. A fuzzer is fuzzing.cc and a file that defines fuzzed_reader().
struct FuzzedReader {
  /// Reads a text; returns the law that was broken, or nothing. A text that is refused breaks none,
  /// if its refusal has a text.
  std::string (*read)(std::string_view text);
  /// Good texts to begin with.
  std::vector<std::string> seeds;
};
[[nodiscard]] const FuzzedReader& fuzzed_reader();

}  // namespace veneer
