// SPDX-License-Identifier: Apache-2.0
#include "btf/communicator.h"

#include <algorithm>
#include <cstdint>
#include <string>

namespace veneer::btf {
Communicator& alone() {
  static Alone communicator;
  return communicator;
}

Status agree(Communicator& ranks, const Status& own) {
  if (ranks.size() == 1) return own;
  struct Failure {
    int rank;
    Errc code;
    std::size_t length;
  };
  std::vector<Failure> failures;
  std::string text;
  if (!own) {
    failures.push_back({ranks.rank(), own.error().code, own.error().what.size()});
    text = own.error().what;
  }
  failures = gather<Failure>(ranks, failures);
  const std::vector<char> texts = gather<char>(ranks, text);
  if (failures.empty()) return {};
  const Failure& first = failures.front();
  return fail(
      first.code,
      "rank {}: {}",
      first.rank,
      std::string(texts.begin(), texts.begin() + static_cast<std::ptrdiff_t>(first.length)));
}

RowRange rows_of_rank(int rows, const Communicator& ranks) {
  constexpr int kMostAligned = 4096;
  // Rows of the rank that has most of them, when ranks begin at multiples of `unit`.
  const auto most = [&](std::int64_t unit) {
    const std::int64_t units = (rows + unit - 1) / unit;
    return (units + ranks.size() - 1) / ranks.size() * unit;
  };
  std::int64_t unit = kMostAligned;
  while (unit > 1 && 4 * ranks.size() * most(unit) > std::int64_t{5} * rows) unit /= 2;
  const std::int64_t units = (rows + unit - 1) / unit;
  const auto start = [&](std::int64_t rank) {
    return static_cast<int>(std::min<std::int64_t>(rows, units * rank / ranks.size() * unit));
  };
  const int first = start(ranks.rank());
  return {first, start(ranks.rank() + 1) - first};
}

}  // namespace veneer::btf
