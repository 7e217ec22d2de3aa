// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

/// Times single queries of a pose track at the moment of display while another thread adds samples
/// to it, and what a look at the clock costs beside them.
[[nodiscard]] Result<int> bench_query(CommandLine& line);

}  // namespace veneer::cli
