// SPDX-License-Identifier: Apache-2.0
#include "cli/command_line.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <new>

#include "base/exit_code.h"

namespace veneer::cli {

CommandLine::CommandLine(const std::string& name,
                         std::string summary,
                         std::vector<std::string> arguments)
    : app_(std::move(summary), "veneer " + name), arguments_(std::move(arguments)) {
  app_.add_flag("--json", json_, "Print one JSON object on standard output and nothing else there");
  app_.add_flag("--quiet", quiet_, "Show no progress");
}

void CommandLine::parse() {
  std::ranges::reverse(arguments_);  // CLI11 takes them last first
  app_.parse(arguments_);
  if (quiet_) {
    progress_ = std::make_unique<SilentProgress>();
  } else {
    progress_ = make_progress();
  }
}

void CommandLine::print(const nlohmann::ordered_json& object, const std::string& text) const {
  const std::string line = json_ ? object.dump() : text;
  if (!line.empty()) fmt::print("{}\n", line);
}

void CommandLine::note(const std::string& text) const {
  if (!quiet_) fmt::print(stderr, "{}\n", text);
}

int run_command(const Command& command, std::vector<std::string> arguments) {
  CommandLine line(std::string(command.name), std::string(command.summary), std::move(arguments));
  try {
    const Result<int> exit_code = command.run(line);
    if (exit_code) return *exit_code;
    fmt::print(stderr, "veneer {}: {}\n", command.name, exit_code.error().what);
    return exit_code_of(exit_code.error());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr,
               "veneer {}: there is not enough memory; close other programs, or crop the data\n",
               command.name);
    return kExitFailed;
  } catch (const CLI::ParseError& error) {
    return line.app().exit(error) == 0 ? kExitDone : kExitUsage;
  }
}

}  // namespace veneer::cli
