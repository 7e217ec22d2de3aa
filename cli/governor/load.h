// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <thread>
#include <vector>

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
  OtherPrograms() : begin_(look()) {}
  [[nodiscard]] std::optional<double> share() const;

 private:
  struct Look {
    double second = 0;
    double all_s = 0;   ///< processor time that anyone used
    double ours_s = 0;  ///< of this
  };
  static std::optional<Look> look();
  std::optional<Look> begin_;
};

}  // namespace veneer::cli
