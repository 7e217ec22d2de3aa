// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "cli/command_line.h"

namespace veneer::cli {

struct BenchGovernorOptions {
  std::string size = "128x96";  ///< pixels of the projector
  double seconds = 30;          ///< of the three phases together
  double frame_hz = 20;
  int busy_threads = 0;  ///< of the load; 0: one for each processor
  bool gate = false;     ///< exit 3 where a gate is missed
};

/// Drives the quality's governor on this machine with a real renderer, real time and real load: a
/// third of the time without, a third under threads that want a processor all the time, a third
/// without. Frames are drawn at a steady pace on a ladder of what can be taken off one fitted
/// material, whose ratios are timed first. The deadline is 1.3 times what the cheapest rung takes
/// under that load, the median, which is timed next. Where other programs come and go, no rung may
/// keep it: the cheapest is drawn now and then between the frames, and what part of these probes
/// kept it is what any governor could do at most.
///
/// A frame is steady where load and rung have been the same for two seconds. The gates: at least
/// 99 % of each phase's steady frames within the deadline; a second between any two steps; never
/// back and forth and back under one load; in the end a rung as good as before the load came.
/// Errors: kInvalidOption, kUnavailable (no GL, or no rung is cheaper than another), those of the
/// fit.
[[nodiscard]] Result<int> bench_governor(const BenchGovernorOptions& options, CommandLine& line);

}  // namespace veneer::cli
