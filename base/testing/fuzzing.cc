// SPDX-License-Identifier: Apache-2.0
// The body of every fuzzer of texts: what a reader makes of whatever libFuzzer comes up with.
#include "base/testing/fuzzing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>

using namespace veneer;

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv);
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

/// Writes the seeds into the first folder on the command line.
extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const std::vector<std::string> arguments(*argv + 1, *argv + *argc);
  const auto corpus = std::ranges::find_if(
      arguments, [](const std::string& each) { return std::filesystem::is_directory(each); });
  if (corpus == arguments.end()) return 0;
  const std::vector<std::string>& seeds = fuzzed_reader().seeds;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    std::ofstream file(fmt::format("{}/seed-{}", *corpus, i), std::ios::binary);
    file << seeds[i];
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string law = fuzzed_reader().read({reinterpret_cast<const char*>(data), size});
  if (!law.empty()) {
    fmt::print(stderr, "broken: {}\n", law);
    std::abort();
  }
  return 0;
}
