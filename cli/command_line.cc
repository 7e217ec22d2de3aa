// SPDX-License-Identifier: Apache-2.0
#include "cli/command_line.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <new>
#include <utility>

#include "base/exit_code.h"

namespace veneer::cli {
namespace {

/// Ends a command whose declarations were all that was wanted. No error, and not for its eyes.
struct Declared {};

/// What is wrong with a command line, as "veneer tell: ...", and where it is explained.
std::string mistake_in(const CLI::App* app, const CLI::Error& error) {
  std::string name = app->get_name();
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands().front();
    name += " " + app->get_name();
  }
  std::string what = error.what();
  if (app->get_require_subcommand_min() > 0 && error.get_name() == "RequiredError") {
    // CLI11 says no more than that one is required.
    std::string known;
    for (const CLI::App* each : app->get_subcommands([](const CLI::App*) { return true; })) {
      if (!each->get_name().empty()) known += (known.empty() ? "" : ", ") + each->get_name();
    }
    const std::vector<std::string> unknown = app->remaining();
    what = fmt::format("{}say what to do: {}",
                       unknown.empty() ? "" : fmt::format("there is no \"{}\"; ", unknown.front()),
                       known);
  }
  return fmt::format("{}: {}\n{} --help explains it.\n", name, what, name);
}

}  // namespace

CommandLine::CommandLine(const std::string& name,
                         std::string summary,
                         std::vector<std::string> arguments)
    : app_(std::move(summary), "veneer " + name), arguments_(std::move(arguments)) {
  app_.failure_message(&mistake_in);
  app_.add_flag("--json", json_, "Print one JSON object on standard output and nothing else there");
  app_.add_flag("--quiet", quiet_, "Show no progress");
}

bool CommandLine::starts_with(const std::string& name, std::string summary) {
  variants_.push_back({name, std::move(summary)});
  return !arguments_.empty() && arguments_.front() == name;
}

void CommandLine::parse() {
  if (only_declare_) throw Declared{};
  if (!variants_.empty() && app_.get_footer().empty()) {
    std::string footer = "Its other tasks, each with options of its own:";
    for (const Variant& variant : variants_)
      footer += fmt::format("\n  {} {} --help: {}", app_.get_name(), variant.name, variant.summary);
    app_.footer(footer);
  }
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

manual::Usage usage_of(const Command& command) {
  const auto declare = [&command](CommandLine& line) {
    line.only_declare_ = true;
    try {
      (void)command.run(line);
    } catch (const Declared&) {
      return;
    }
    VENEER_CHECK(false);  // a command parses before it does anything
  };
  const std::string name(command.name);
  CommandLine line(name, std::string(command.summary), {});
  declare(line);
  manual::Usage usage = manual::usage_of(line.app(), line.app().get_name());
  for (const CommandLine::Variant& variant : line.variants_) {
    CommandLine each(name + " " + variant.name, variant.summary, {variant.name});
    declare(each);
    manual::Usage task = manual::usage_of(each.app(), each.app().get_name());
    // It declares its own name as an argument or as a command: neither is shown again.
    const std::string word = manual::upper(variant.name);
    std::erase_if(task.options, [&word](const manual::Option& option) {
      return option.names.empty() && option.value == word;
    });
    for (const manual::Usage& below : std::exchange(task.commands, {})) {
      for (const manual::Option& option : below.options) {
        if (std::ranges::find(task.options, option.names, &manual::Option::names) ==
                task.options.end() ||
            option.names.empty())
          task.options.push_back(option);
      }
    }
    task.command_required = false;
    usage.commands.push_back(std::move(task));
  }
  return usage;
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
