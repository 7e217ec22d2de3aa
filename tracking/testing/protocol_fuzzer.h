// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "tracking/testing/protocol_laws.h"

namespace veneer::tracking {

/// What a fuzzer feeds. A fuzzer is protocol_fuzzer.cc and a file that defines fuzzed_protocol().
struct FuzzedProtocol {
  Framing framing = Framing::kStream;
  MakeProtocol make;
  /// Good input to begin with, each the pieces of one conversation; a piece of messages has 255
  /// bytes at most.
  std::vector<std::vector<std::vector<std::byte>>> seeds;
};
[[nodiscard]] const FuzzedProtocol& fuzzed_protocol();

}  // namespace veneer::tracking
