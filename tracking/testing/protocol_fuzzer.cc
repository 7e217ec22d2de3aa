// SPDX-License-Identifier: Apache-2.0
// The body of every fuzzer of a protocol: the laws of protocol_laws.h on whatever libFuzzer comes
// up with.
//
// An input is, for a stream, two bytes that say where it is cut and then the stream; for messages,
// one byte that says how long a message is and then the message, again and again.
#include "tracking/testing/protocol_fuzzer.h"

#include <algorithm>

#include "base/testing/fuzzing.h"

namespace veneer::tracking {
namespace {

std::string encoded(const std::vector<std::vector<std::byte>>& pieces, Framing framing) {
  std::string input;
  if (framing == Framing::kStream) input = "\x55\x55";
  for (const std::vector<std::byte>& piece : pieces) {
    if (framing == Framing::kMessages) input += static_cast<char>(piece.size());
    input.append(reinterpret_cast<const char*>(piece.data()), piece.size());
  }
  return input;
}

/// A good conversation has a pose.
Verdict read(std::string_view text) {
  std::span<const std::byte> input = std::as_bytes(std::span(text));
  const FuzzedProtocol& fuzzed = fuzzed_protocol();
  std::vector<std::span<const std::byte>> pieces;
  std::size_t cut = 0;
  if (fuzzed.framing == Framing::kStream) {
    if (input.size() < 2) return refused("no place to cut it");
    pieces.push_back(input.subspan(2));
    cut = std::to_integer<std::size_t>(input[0]) << 8U | std::to_integer<std::size_t>(input[1]);
  } else {
    while (!input.empty()) {
      const std::size_t size =
          std::min(std::to_integer<std::size_t>(input.front()), input.size() - 1);
      pieces.push_back(input.subspan(1, size));
      input = input.subspan(1 + size);
    }
  }
  std::string broken = broken_law(fuzzed.make, fuzzed.framing, pieces, cut);
  if (!broken.empty()) return accepted(std::move(broken));
  if (understand(*fuzzed.make(), pieces).samples.empty()) return refused("no pose in it");
  return accepted();
}

}  // namespace
}  // namespace veneer::tracking

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace tracking;
  static const FuzzedReader kReader = [] {
    const FuzzedProtocol& fuzzed = fuzzed_protocol();
    // Four copies of the bytes and two of the samples, in arrays that double. A message may be
    // empty, and its place in a list has 16 bytes.
    const std::size_t bytes_per_byte = fuzzed.framing == Framing::kStream ? 32 : 64;
    FuzzedReader reader{&read, {}, {1024, bytes_per_byte}};
    for (const auto& pieces : fuzzed.seeds) {
      const std::string seed = encoded(pieces, fuzzed.framing);
      reader.seeds.push_back(seed);
      // And as much of it as an input may hold, since a short one says nothing of what is kept.
      constexpr std::size_t kLongest = 4096;
      std::vector<std::vector<std::byte>> many = pieces;
      for (std::size_t size = 2 * seed.size(); size <= kLongest; size += seed.size())
        many.insert(many.end(), pieces.begin(), pieces.end());
      reader.seeds.push_back(encoded(many, fuzzed.framing));
    }
    return reader;
  }();
  return kReader;
}
