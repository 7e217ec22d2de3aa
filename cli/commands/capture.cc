// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/capture_session.h"
#include "cli/commands/capture_stokes.h"
#include "cli/commands/commands.h"

namespace veneer::cli {

Result<int> run_capture(CommandLine& line) {
  const std::string what = line.first_argument();
  if (what == "board") return capture_board(line);
  if (what == "demo") return capture_demo(line);
  if (what == "stokes") return capture_stokes(line);
  return capture_session(line);
}

}  // namespace veneer::cli
