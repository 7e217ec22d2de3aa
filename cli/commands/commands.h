// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cli/command_line.h"

namespace veneer::cli {

Result<int> run_bench(CommandLine& line);
Result<int> run_calibrate(CommandLine& line);
Result<int> run_capture(CommandLine& line);
Result<int> run_compare(CommandLine& line);
Result<int> run_demo(CommandLine& line);
Result<int> run_doctor(CommandLine& line);
Result<int> run_evaluate(CommandLine& line);
Result<int> run_expand(CommandLine& line);
Result<int> run_fit(CommandLine& line);
Result<int> run_harness(CommandLine& line);
Result<int> run_import(CommandLine& line);
Result<int> run_plan(CommandLine& line);
Result<int> run_projector(CommandLine& line);
Result<int> run_render(CommandLine& line);
Result<int> run_status(CommandLine& line);
Result<int> run_synthesize(CommandLine& line);
Result<int> run_tell(CommandLine& line);
Result<int> run_track(CommandLine& line);
Result<int> run_trade(CommandLine& line);
Result<int> run_verify(CommandLine& line);

}  // namespace veneer::cli
