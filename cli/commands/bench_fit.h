// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "btf/material.h"
#include "cli/command_line.h"

namespace veneer::cli {

/// Times the fit of a clustered model as it is, with clusters found in a randomised basis, against
/// the same fit on the full vectors: same starts, swaps, seed, BLAS and threads. Prints seconds,
/// processor seconds and errors of both.
/// Errors: those of opening, fitting and evaluating.
[[nodiscard]] Result<int> bench_fit(const std::filesystem::path& set,
                                    const btf::Model& model,
                                    const btf::FitOptions& options,
                                    CommandLine& line);

}  // namespace veneer::cli
