// SPDX-License-Identifier: Apache-2.0
// veneer-bench: `veneer bench` as a program of its own, which is linked without OpenCV, so that it
// can be carried to a machine with a GPU and nothing else.
#include "cli/command_line.h"
#include "cli/commands/commands.h"

int main(int argc, char** argv) {
  using namespace veneer::cli;
  constexpr Command kBench{
      "bench",
      "Time what this machine does: render, fit, query, colour, latency, governor, layers",
      &run_bench};
  return run_command(kBench, {argv + (argc > 0 ? 1 : 0), argv + argc});
}
