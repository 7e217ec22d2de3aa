// SPDX-License-Identifier: Apache-2.0
// The body of every fuzzer: what a reader makes of whatever libFuzzer comes up with.
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

namespace {

/// How an input used memory.
struct Use {
  std::size_t size = 0;  ///< of what the reader was given
  std::size_t bytes = 0;
  std::size_t bound = 1;

  [[nodiscard]] double share() const {
    return static_cast<double>(bytes) / static_cast<double>(bound);
  }
};

/// Of all inputs so far, the one that came nearest to its bound.
Use nearest;

[[noreturn]] void stop(const std::string& broken) {
  fmt::print(stderr, "broken: {}\n", broken);
  std::abort();
}

/// What `./dev fuzz` shows of a run.
void tell_nearest() {
  fmt::print(stderr,
             "memory: at most {:.0f} % of the bound: {} bytes of {} for an input of {}\n",
             100 * nearest.share(),
             nearest.bytes,
             nearest.bound,
             nearest.size);
}

/// The reader's refusal; ends the program where a law is broken.
std::string refusal_of(std::string_view input) {
  const FuzzedReader& reader = fuzzed_reader();
  std::string made;
  if (reader.make != nullptr) {
    made = reader.make(input);
    input = made;
  }
  Verdict verdict;
  Use use{input.size(), 0, reader.memory.of(input.size())};
  use.bytes = most_in_use([&] { verdict = reader.read(input); }, use.bound);
  if (!verdict.broken.empty()) stop(verdict.broken);
  if (use.bytes > use.bound)
    stop(fmt::format("{} bytes of memory in use for an input of {}, which justifies {}",
                     use.bytes,
                     use.size,
                     use.bound));
  if (use.share() > nearest.share()) nearest = use;
  return verdict.refusal;
}

}  // namespace

/// Looks whether good inputs are good and writes the seeds into the first folder on the command
/// line.
extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  check_that_use_is_counted();
  const FuzzedReader& reader = fuzzed_reader();
  for (std::size_t i = 0; i < reader.seeds.size(); ++i) {
    const std::string refusal = refusal_of(reader.seeds[i]);
    if (!refusal.empty()) stop(fmt::format("the good input {} is refused: {}", i, refusal));
  }
  if (reader.seeds.empty()) stop("there is no good input to begin with");
  std::atexit(&tell_nearest);
  const std::vector<std::string> arguments(*argv + 1, *argv + *argc);
  const auto corpus = std::ranges::find_if(
      arguments, [](const std::string& each) { return std::filesystem::is_directory(each); });
  if (corpus == arguments.end()) return 0;
  std::vector<std::string> seeds = reader.seeds;
  seeds.insert(seeds.end(), reader.odd_seeds.begin(), reader.odd_seeds.end());
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    // A long one has been looked at above; libFuzzer would spend its time on it.
    constexpr std::size_t kLongest = 2048;
    if (seeds[i].size() > kLongest) continue;
    std::ofstream file(fmt::format("{}/seed-{}", *corpus, i), std::ios::binary);
    file << seeds[i];
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static_cast<void>(refusal_of({reinterpret_cast<const char*>(data), size}));
  return 0;
}
