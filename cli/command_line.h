// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json_fwd.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/manual/usage.h"
#include "base/progress.h"
#include "base/result.h"

namespace veneer::cli {

struct Command;

/// What every command has in common: its arguments, --json, --quiet, progress and the result.
class CommandLine {
 public:
  CommandLine(const std::string& name, std::string summary, std::vector<std::string> arguments);

  /// Where a command declares its options, before parse().
  [[nodiscard]] CLI::App& app() { return app_; }
  /// Whether the first argument is `name`: for commands that do different things, each with options
  /// of its own. Before parse(). What was asked for is listed in the help and the manual.
  [[nodiscard]] bool starts_with(const std::string& name, std::string summary);
  /// Reads the arguments into the declared options. Throws CLI::ParseError, which main() turns into
  /// help or a usage error.
  void parse();
  /// Silent with --quiet; writes to standard error only.
  [[nodiscard]] Progress& progress() { return *progress_; }
  [[nodiscard]] bool json() const { return json_; }
  [[nodiscard]] bool quiet() const { return quiet_; }
  /// Prints the result: `object` with --json, else `text` (nothing where it is empty).
  void print(const nlohmann::ordered_json& object, const std::string& text) const;
  /// A remark on standard error, unless --quiet.
  void note(const std::string& text) const;

 private:
  friend manual::Usage usage_of(const Command& command);

  CLI::App app_;
  std::vector<std::string> arguments_;
  struct Variant {
    std::string name;
    std::string summary;
  };
  std::vector<Variant> variants_;  // that starts_with() was asked for
  bool only_declare_ = false;      // parse() ends the command
  bool json_ = false;
  bool quiet_ = false;
  std::unique_ptr<Progress> progress_;
};

/// A command: declares its options, parses, works, prints; returns the exit code.
using RunCommand = Result<int> (*)(CommandLine& line);

/// One line of a program's table of commands.
struct Command {
  std::string_view name;
  std::string_view summary;
  RunCommand run;
};
/// What the command declares, found by running it as far as its parse(). Its names for what it can
/// do (CommandLine::starts_with) are commands below it.
[[nodiscard]] manual::Usage usage_of(const Command& command);
/// Runs a command with its arguments; says on standard error what went wrong. Returns the program's
/// exit code.
[[nodiscard]] int run_command(const Command& command, std::vector<std::string> arguments);

}  // namespace veneer::cli
