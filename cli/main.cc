// SPDX-License-Identifier: Apache-2.0
// veneer: every tool around the daemon.
#include <algorithm>
#include <array>
#include <string_view>

#include "base/exit_code.h"
#include "cli/command_line.h"
#include "cli/commands/commands.h"
#include "cli/manual_pages.h"

namespace {

using namespace veneer;

using cli::Command;

// These two speak of the whole table.
Result<int> run_completion(cli::CommandLine& line);
Result<int> run_manual(cli::CommandLine& line);

constexpr std::array kCommands{
    Command{
        "bench",
        "Time what this machine does: bench render, fit, query, colour, latency, governor, layers",
        &cli::run_bench},
    Command{"calibrate",
            "Lead through measuring a projector and write its profile",
            &cli::run_calibrate},
    Command{"capture", "Look at samples under polarised light", &cli::run_capture},
    Command{"compare",
            "Fit every model of the literature and print the published tables",
            &cli::run_compare},
    Command{"completion", "Print what makes a shell complete the words of veneer", &run_completion},
    Command{"demo",
            "Run the main job without hardware and report what the eye receives",
            &cli::run_demo},
    Command{"doctor", "Say what this machine offers and what is missing", &cli::run_doctor},
    Command{"evaluate", "Measure how well a material reproduces a sample set", &cli::run_evaluate},
    Command{"expand", "Cover a larger tile with a material of a small sample", &cli::run_expand},
    Command{"fit", "Fit a model to a sample set", &cli::run_fit},
    Command{
        "harness", "Rehearse the daemon with a tracker that fails as planned", &cli::run_harness},
    Command{"import", "Bring measured data of another format to a sample set", &cli::run_import},
    Command{"manual", "Write the manual pages of veneer", &run_manual},
    Command{"plan", "Fit only what a scene can ask of a material", &cli::run_plan},
    Command{"projector", "Say how a projector is, and switch it", &cli::run_projector},
    Command{"render", "Draw one projector frame of a scene", &cli::run_render},
    Command{"status", "Say how the service is", &cli::run_status},
    Command{"synthesize", "Path-trace a material as a sample set", &cli::run_synthesize},
    Command{"tell", "Have the service show something else, or go dark", &cli::run_tell},
    Command{"track", "List, watch and record trackers", &cli::run_track},
    Command{"trade",
            "Measure on a scene what each way to draw costs and how far off it is",
            &cli::run_trade},
    Command{"verify",
            "Hold a profile against fresh readings, or a run against its material",
            &cli::run_verify},
};
static_assert(std::ranges::is_sorted(kCommands, {}, &Command::name));

Result<int> run_completion(cli::CommandLine& line) {
  return cli::print_completion(line, kCommands);
}
Result<int> run_manual(cli::CommandLine& line) { return cli::write_manual(line, kCommands); }

void print_usage(std::FILE* stream) {
  fmt::print(stream, "usage: veneer COMMAND [OPTIONS]\n\n");
  for (const Command& command : kCommands)
    fmt::print(stream, "  {:<12} {}\n", command.name, command.summary);
  fmt::print(stream, "\nveneer COMMAND --help explains one.\n");
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  if (arguments.empty()) {
    print_usage(stderr);
    return kExitUsage;
  }
  if (arguments.front() == "--help" || arguments.front() == "-h" || arguments.front() == "help") {
    print_usage(stdout);
    return kExitDone;
  }
  const auto* command = std::ranges::find(kCommands, arguments.front(), &Command::name);
  if (command == kCommands.end()) {
    fmt::print(stderr, "veneer: there is no command \"{}\"\n", arguments.front());
    print_usage(stderr);
    return kExitUsage;
  }
  return cli::run_command(*command, {arguments.begin() + 1, arguments.end()});
}
