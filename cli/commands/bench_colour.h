// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

/// Measures every colour model on invented projectors (calibration/colour/ladder.h) and prints
/// their colour differences, and those of the model that is chosen. Errors: those of the fits,
/// which are ours. Exit 3 if a chosen model misses its gate: mean, 95th percentile and maximum of
/// dE00 of 0.5, 1 and 2 where channels add up, of 1, 2 and 4 elsewhere, at 52 patches.
[[nodiscard]] Result<int> bench_colour(CommandLine& line);

}  // namespace veneer::cli
