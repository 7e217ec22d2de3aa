// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>

namespace veneer {

/// What the machine's processors had done at a moment.
struct ProcessorTime {
  std::chrono::steady_clock::time_point when;
  double all_s = 0;   ///< processor time that anyone used
  double ours_s = 0;  ///< of this
};
/// Nothing where the kernel does not tell.
[[nodiscard]] std::optional<ProcessorTime> processor_time();

/// What other programs had of the processors between two moments: 1 is all of them. Nothing where
/// no time has passed.
[[nodiscard]] std::optional<double> share_of_others(const ProcessorTime& from,
                                                    const ProcessorTime& to);

}  // namespace veneer
