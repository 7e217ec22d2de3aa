// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "base/result.h"

namespace veneer::btf {

/// Processes that work on one task together, each on rows of its own. All of them call the same
/// functions in the same order; each call returns the same bits on every rank, and the same bits
/// each time the job is run on as many ranks.
class Communicator {
 public:
  virtual ~Communicator() = default;
  [[nodiscard]] virtual int rank() const = 0;  ///< 0 to size() - 1
  [[nodiscard]] virtual int size() const = 0;
  /// Replaces `values`, as many on every rank, by their sums over the ranks.
  virtual void sum(std::span<double> values) = 0;
  /// What each rank has to say, which may differ in length: rank 0's bytes first.
  [[nodiscard]] virtual std::vector<std::byte> gather(std::span<const std::byte> own) = 0;
};

/// The rank of a process that works alone.
class Alone final : public Communicator {
 public:
  [[nodiscard]] int rank() const override { return 0; }
  [[nodiscard]] int size() const override { return 1; }
  void sum(std::span<double>) override {}
  [[nodiscard]] std::vector<std::byte> gather(std::span<const std::byte> own) override {
    return {own.begin(), own.end()};
  }
};
[[nodiscard]] Communicator& alone();

/// Communicator::gather() of plain numbers.
template <class T>
[[nodiscard]] std::vector<T> gather(Communicator& ranks, std::span<const T> own) {
  static_assert(std::is_trivially_copyable_v<T>);
  const std::vector<std::byte> bytes = ranks.gather(std::as_bytes(own));
  std::vector<T> all(bytes.size() / sizeof(T));
  if (!all.empty()) std::memcpy(all.data(), bytes.data(), bytes.size());
  return all;
}

/// The same outcome on every rank: the first rank's error of those that have one. What may fail on
/// one rank only must pass through it, for the others would wait for that rank.
[[nodiscard]] Status agree(Communicator& ranks, const Status& own);

/// The rows [first, first + count).
struct RowRange {
  int first = 0;
  int count = 0;
};

/// The rows of `rows` that belong to a rank. Ranks differ by a quarter of their share at most, and
/// begin at rows that are multiples of a power of two as large as that allows: products are then
/// made in the same blocks, and rounded in the same way, on any number of ranks.
[[nodiscard]] RowRange rows_of_rank(int rows, const Communicator& ranks);

}  // namespace veneer::btf
