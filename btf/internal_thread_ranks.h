// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <barrier>
#include <thread>
#include <vector>

#include "btf/communicator.h"

namespace veneer::btf {

/// For tests: runs body(ranks) on `size` ranks, threads of this process, and returns when all are
/// done.
template <class Body>
void run_on_ranks(int size, Body body) {
  struct Meeting {
    std::barrier<> barrier;
    std::vector<std::vector<double>> values;
    std::vector<std::vector<std::byte>> bytes;
  };
  class Rank final : public Communicator {
   public:
    Rank(Meeting& meeting, int rank) : meeting_(meeting), rank_(rank) {}
    int rank() const override { return rank_; }
    int size() const override { return static_cast<int>(meeting_.values.size()); }
    void sum(std::span<double> values) override {
      meeting_.values[static_cast<std::size_t>(rank_)].assign(values.begin(), values.end());
      meeting_.barrier.arrive_and_wait();
      std::ranges::fill(values, 0.0);
      for (const std::vector<double>& others : meeting_.values) {
        VENEER_CHECK(others.size() == values.size());
        std::ranges::transform(values, others, values.begin(), std::plus());
      }
      meeting_.barrier.arrive_and_wait();
    }
    std::vector<std::byte> gather(std::span<const std::byte> own) override {
      meeting_.bytes[static_cast<std::size_t>(rank_)].assign(own.begin(), own.end());
      meeting_.barrier.arrive_and_wait();
      std::vector<std::byte> all;
      for (const std::vector<std::byte>& bytes : meeting_.bytes)
        all.insert(all.end(), bytes.begin(), bytes.end());
      meeting_.barrier.arrive_and_wait();
      return all;
    }

   private:
    Meeting& meeting_;
    int rank_;
  };
  const auto count = static_cast<std::size_t>(size);
  Meeting meeting{std::barrier<>(size),
                  std::vector<std::vector<double>>(count),
                  std::vector<std::vector<std::byte>>(count)};
  std::vector<std::jthread> threads;
  for (int rank = 0; rank < size; ++rank)
    threads.emplace_back([&meeting, &body, rank] {
      Rank ranks(meeting, rank);
      body(static_cast<Communicator&>(ranks));
    });
}

}  // namespace veneer::btf
