// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "cli/command_line.h"

namespace veneer::cli {

struct BenchLatencyOptions {
  std::string size = "320x240";  ///< pixels of the projector
  double seconds = 10;
  double tracker_hz = 240;
  double frame_hz = 60;
};

/// Runs veneerd in real time with a simulated tracker and an output that takes every frame, and
/// tells where the time from a pose to its light went.
///
/// The gate: the tracker's transport, the hand-over, the frame loop's own work and the handing to
/// the output take less than 0.5 ms together, medians. Waiting for a frame's turn, the GPU's passes
/// and the display are not in it; with a software rasteriser the GL calls that draw count as those
/// passes, so that only a GPU shows what issuing them costs. Missed: exit code 3.
/// Errors: kInvalidOption, kIo (veneerd failed), kBadFormat (its summary).
[[nodiscard]] Result<int> bench_latency(const BenchLatencyOptions& options, CommandLine& line);

}  // namespace veneer::cli
