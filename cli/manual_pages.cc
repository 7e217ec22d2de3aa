// SPDX-License-Identifier: Apache-2.0
#include "cli/manual_pages.h"

#include <nlohmann/json.hpp>

#include <filesystem>
#include <system_error>

#include "base/exit_code.h"
#include "base/files.h"
#include "base/manual/completion.h"
#include "base/manual/roff.h"

namespace veneer::cli {
namespace {

const std::string kExitStatus =
    "*0: done\n\n*1: failed; standard error says what went wrong and what to do about it\n\n"
    "*2: wrong usage, or a value of a file that has to be corrected\n\n"
    "*3: done, but a stated quality gate was missed";

constexpr auto kSummary = "measure, fit, calibrate and look after a projection that veneerd drives";

manual::Usage usage_of_veneer(std::span<const Command> commands) {
  manual::Usage usage;
  usage.invocation = "veneer";
  usage.summary = kSummary;
  usage.command_required = true;
  for (const Command& command : commands) usage.commands.push_back(usage_of(command));
  return usage;
}

std::string page_name(const Command& command) { return fmt::format("veneer-{}", command.name); }

/// veneer.1, which lists the commands and leaves their options to their own pages.
std::string overview(std::span<const Command> commands) {
  manual::Usage usage;
  usage.invocation = "veneer";
  usage.summary = kSummary;
  manual::Option command;
  command.value = "COMMAND";
  command.text = "One of those below.";
  command.required = true;
  usage.options = {command};
  manual::Page page;
  page.name = "veneer";
  std::string list;
  for (const Command& each : commands)
    list += fmt::format("*{}: {}; see {}(1).\n\n", each.name, each.summary, page_name(each));
  page.sections = {{"Commands", list},
                   {"Exit status", kExitStatus},
                   {"Files",
                    "*/usr/share/veneer: configuration of the demo, scenes, virtual benches, "
                    "rehearsals and studios that veneer takes by default\n\n"
                    "*/usr/share/doc/veneer: how things are done, and why"}};
  page.see_also = {"veneerd(8)", "veneer.toml(5)"};
  return manual::to_roff(usage, page);
}

}  // namespace

Result<int> print_completion(CommandLine& line, std::span<const Command> commands) {
  std::string shell;
  line.app()
      .add_option("shell", shell, "Whose script is printed")
      ->required()
      ->check(CLI::IsMember({"bash", "fish", "zsh"}));
  line.parse();
  const manual::Usage usage = usage_of_veneer(commands);
  const std::string script = shell == "bash"   ? manual::bash_completion(usage)
                             : shell == "fish" ? manual::fish_completion(usage)
                                               : manual::zsh_completion(usage);
  line.print({{"shell", shell}, {"script", script}}, script);
  return kExitDone;
}

Result<int> write_manual(CommandLine& line, std::span<const Command> commands) {
  std::filesystem::path folder;
  line.app().add_option("folder", folder, "Where the pages are written")->required();
  line.parse();
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return fail(Errc::kIo, "making {}: {}", folder.string(), error.message());
  VENEER_TRY(write_text(folder / "veneer.1", overview(commands)));
  for (const Command& command : commands) {
    manual::Page page;
    page.name = page_name(command);
    page.sections = {{"Exit status", kExitStatus}};
    page.see_also = {"veneer(1)", "veneerd(8)"};
    VENEER_TRY(write_text(folder / (page.name + ".1"), manual::to_roff(usage_of(command), page)));
  }
  line.print({{"folder", folder.string()}, {"pages", commands.size() + 1}},
             fmt::format("wrote {} pages into {}", commands.size() + 1, folder.string()));
  return kExitDone;
}

}  // namespace veneer::cli
