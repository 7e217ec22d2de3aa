// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/testing/allocation_bound.h"

namespace veneer {

/// What a reader made of an input.
struct Verdict {
  std::string broken;   ///< the law that was broken, or nothing
  std::string refusal;  ///< why the reader refused it; empty where it was accepted
};
/// What was accepted, and the law that it breaks, if any.
[[nodiscard]] inline Verdict accepted(std::string broken = "") { return {std::move(broken), ""}; }
/// A refusal breaks no law, if it has a text.
[[nodiscard]] inline Verdict refused(std::string why) {
  return {why.empty() ? "a refusal without a text" : "", std::move(why)};
}
[[nodiscard]] inline Verdict refused(const Error& error) { return refused(error.what); }

/// What a fuzzer feeds. A fuzzer is a file that defines fuzzed_reader(); fuzzing.cc does the rest:
/// no law may be broken, no good input refused, and no more memory be in use than the input
/// justifies.
struct FuzzedReader {
  Verdict (*read)(std::string_view input);
  /// Good inputs to begin with; one that is refused ends the fuzzer.
  std::vector<std::string> seeds;
  /// About four times what good inputs use.
  AllocationBound memory;
  /// Inputs to begin with that are refused, or may be: those that once did harm.
  std::vector<std::string> odd_seeds = {};
  /// What the reader is given, where an input only says how to make it; `memory` is in proportion
  /// to that then, and the making counts for nothing.
  std::string (*make)(std::string_view input) = nullptr;
};
[[nodiscard]] const FuzzedReader& fuzzed_reader();

}  // namespace veneer
