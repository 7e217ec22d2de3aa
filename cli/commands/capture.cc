// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/capture_session.h"
#include "cli/commands/capture_stokes.h"
#include "cli/commands/commands.h"

namespace veneer::cli {

Result<int> run_capture(CommandLine& line) {
  if (line.starts_with("board", "Draw the board of marks that is printed and laid beside a sample"))
    return capture_board(line);
  if (line.starts_with("demo", "Go the whole way from pictures to frames in a virtual studio"))
    return capture_demo(line);
  if (line.starts_with("stokes", "Measure the polarisation in one raw mosaic"))
    return capture_stokes(line);
  return capture_session(line);
}

}  // namespace veneer::cli
