// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

struct BenchLayersOptions {
  int texels = 32;      ///< along each side
  int directions = 81;  ///< of view and of light
  int samples = 16;     ///< paths per texel and view
  int seeds = 5;
  bool gate = false;
};

/// What `layered` gives back of the materials whose geometry is known (simulation/recovery): for
/// each of them and each seed, layers and normals against the truth, the error beside the noise and
/// beside clustered models, and the error in grazing views that no fit saw.
/// Errors: kInvalidOption, kIo, those of fitting.
[[nodiscard]] Result<int> bench_layers(const BenchLayersOptions& options, CommandLine& line);

}  // namespace veneer::cli
