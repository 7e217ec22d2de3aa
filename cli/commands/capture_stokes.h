// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

/// `veneer capture stokes IMAGE --layout LAYOUT`: degree and angle of polarisation in a raw picture
/// of a camera with analysers on its sensor.
[[nodiscard]] Result<int> capture_stokes(CommandLine& line);

}  // namespace veneer::cli
