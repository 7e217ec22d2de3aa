// SPDX-License-Identifier: Apache-2.0
#include "cli/governor/load.h"

#include <atomic>
#include <cstdint>

namespace veneer::cli {
namespace {

void keep_busy(const std::stop_token& stop) {
  // Atomic, so that no compiler finds out that nobody wants it.
  std::atomic<std::uint64_t> count{0};
  while (!stop.stop_requested()) count.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

BusyThreads::BusyThreads(std::size_t count) {
  threads_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) threads_.emplace_back(keep_busy);
}

std::optional<double> OtherPrograms::share() const {
  const std::optional<ProcessorTime> now = processor_time();
  return now && begin_ ? share_of_others(*begin_, *now) : std::nullopt;
}

}  // namespace veneer::cli
