// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/capture_stokes.h"
#include "cli/commands/commands.h"

namespace veneer::cli {

Result<int> run_capture(CommandLine& line) {
  if (line.first_argument() == "stokes") return capture_stokes(line);
  line.app().footer(
      "veneer capture stokes --help  polarisation in a raw picture of a polarising sensor");
  line.parse();
  return fail(Errc::kInvalidOption,
              "say what to capture: stokes IMAGE for the polarisation in a raw picture");
}

}  // namespace veneer::cli
