// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

/// `veneer calibrate colour READINGS.ti3`: colour models of readings that are there already.
Result<int> calibrate_colour(CommandLine& line);

}  // namespace veneer::cli
