// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <thread>
#include <vector>

#include "base/processor_time.h"

namespace veneer::cli {

/// Threads that want a processor all the time, as `yes` does, until they are destroyed.
class BusyThreads {
 public:
  explicit BusyThreads(std::size_t count);

 private:
  std::vector<std::jthread> threads_;
};

/// What other programs had of the processors since this was made: 1 is all of them. Nothing where
/// the kernel does not tell.
class OtherPrograms {
 public:
  OtherPrograms() : begin_(processor_time()) {}
  [[nodiscard]] std::optional<double> share() const;

 private:
  std::optional<ProcessorTime> begin_;
};

}  // namespace veneer::cli
