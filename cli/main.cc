// SPDX-License-Identifier: Apache-2.0
// veneer: every tool around the daemon.
#include <algorithm>
#include <array>
#include <new>
#include <string_view>

#include "base/exit_code.h"
#include "cli/command_line.h"
#include "cli/commands/commands.h"

namespace {

using namespace veneer;

struct Command {
  std::string_view name;
  std::string_view summary;
  cli::RunCommand run;
};

constexpr std::array kCommands{
    Command{"bench", "Time what this machine does: bench render, fit, query", &cli::run_bench},
    Command{"calibrate", "Measure a projector and write its profile", &cli::run_calibrate},
    Command{"compare",
            "Fit every model of the literature and print the published tables",
            &cli::run_compare},
    Command{"demo",
            "Run the main job without hardware and report what the eye receives",
            &cli::run_demo},
    Command{"doctor", "Say what this machine offers and what is missing", &cli::run_doctor},
    Command{"evaluate", "Measure how well a material reproduces a sample set", &cli::run_evaluate},
    Command{"fit", "Fit a model to a sample set", &cli::run_fit},
    Command{
        "harness", "Rehearse the daemon with a tracker that fails as planned", &cli::run_harness},
    Command{"import", "Bring measured data of another format to a sample set", &cli::run_import},
    Command{"render", "Draw one projector frame of a scene", &cli::run_render},
    Command{"synthesize", "Path-trace a material as a sample set", &cli::run_synthesize},
    Command{"track", "List, watch and record trackers", &cli::run_track},
    Command{"verify",
            "Show recorded frames on the virtual bench and compare with the material",
            &cli::run_verify},
};
static_assert(std::ranges::is_sorted(kCommands, {}, &Command::name));

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
  cli::CommandLine line(std::string(command->name),
                        std::string(command->summary),
                        {arguments.begin() + 1, arguments.end()});
  try {
    const Result<int> exit_code = command->run(line);
    if (exit_code) return *exit_code;
    fmt::print(stderr, "veneer {}: {}\n", command->name, exit_code.error().what);
    return exit_code_of(exit_code.error());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr,
               "veneer {}: there is not enough memory; close other programs, or crop the data\n",
               command->name);
    return kExitFailed;
  } catch (const CLI::ParseError& error) {
    return line.app().exit(error) == 0 ? kExitDone : kExitUsage;
  }
}
