// SPDX-License-Identifier: Apache-2.0
// The body of every fuzzer: the laws of protocol_laws.h on whatever libFuzzer comes up with.
//
// An input is, for a stream, two bytes that say where it is cut and then the stream; for messages,
// one byte that says how long a message is and then the message, again and again.
#include "tracking/testing/protocol_fuzzer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace {

using namespace veneer::tracking;

std::vector<std::byte> encoded(const std::vector<std::vector<std::byte>>& pieces, Framing framing) {
  std::vector<std::byte> input;
  if (framing == Framing::kStream) input.resize(2, std::byte{0x55});
  for (const std::vector<std::byte>& piece : pieces) {
    if (framing == Framing::kMessages) input.push_back(static_cast<std::byte>(piece.size()));
    input.insert(input.end(), piece.begin(), piece.end());
  }
  return input;
}

std::string broken_law_of(std::span<const std::byte> input) {
  const FuzzedProtocol& fuzzed = fuzzed_protocol();
  std::vector<std::span<const std::byte>> pieces;
  if (fuzzed.framing == Framing::kStream) {
    if (input.size() < 2) return {};
    pieces.push_back(input.subspan(2));
    const std::size_t cut =
        std::to_integer<std::size_t>(input[0]) << 8U | std::to_integer<std::size_t>(input[1]);
    return broken_law(fuzzed.make, fuzzed.framing, pieces, cut);
  }
  while (!input.empty()) {
    const std::size_t size =
        std::min(std::to_integer<std::size_t>(input.front()), input.size() - 1);
    pieces.push_back(input.subspan(1, size));
    input = input.subspan(1 + size);
  }
  return broken_law(fuzzed.make, fuzzed.framing, pieces, 0);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv);
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

/// Writes the seeds into the first folder on the command line.
extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const std::vector<std::string> arguments(*argv + 1, *argv + *argc);
  const auto corpus = std::ranges::find_if(
      arguments, [](const std::string& each) { return std::filesystem::is_directory(each); });
  if (corpus == arguments.end()) return 0;
  const FuzzedProtocol& fuzzed = fuzzed_protocol();
  for (std::size_t i = 0; i < fuzzed.seeds.size(); ++i) {
    const std::vector<std::byte> input = encoded(fuzzed.seeds[i], fuzzed.framing);
    std::ofstream file(fmt::format("{}/seed-{}", *corpus, i), std::ios::binary);
    file.write(reinterpret_cast<const char*>(input.data()),
               static_cast<std::streamsize>(input.size()));
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string law = broken_law_of(std::as_bytes(std::span(data, size)));
  if (!law.empty()) {
    fmt::print(stderr, "broken: {}\n", law);
    std::abort();
  }
  return 0;
}
