// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "cli/command_line.h"

namespace veneer::cli {

// The commands that speak of the table of commands itself: what they say is read from it and from
// what each command declares, so that it cannot differ from what the commands take.

/// Prints the script that makes bash, fish or zsh complete the words of veneer.
[[nodiscard]] Result<int> print_completion(CommandLine& line, std::span<const Command> commands);
/// Writes veneer.1 and a veneer-COMMAND.1 for each command into a folder.
[[nodiscard]] Result<int> write_manual(CommandLine& line, std::span<const Command> commands);

}  // namespace veneer::cli
