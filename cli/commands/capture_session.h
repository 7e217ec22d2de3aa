// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

/// veneer capture --rig rig.toml -o NAME: takes the pictures, NAME/, and develops them into the
/// sample set NAME.btfset with the report NAME/report/index.html.
[[nodiscard]] Result<int> capture_session(CommandLine& line);

/// veneer capture board --rig rig.toml -o board.png: the board to print.
[[nodiscard]] Result<int> capture_board(CommandLine& line);

/// veneer capture demo -o DIR: captures a synthetic sheet in the virtual studio, fits it and has
/// veneerd draw it.
[[nodiscard]] Result<int> capture_demo(CommandLine& line);

}  // namespace veneer::cli
