// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "base/manual/usage.h"

namespace veneer::manual {

// Scripts that a shell reads to complete the words of a program: its commands, the options of the
// command that is there, and what an option may be. Where a value may be anything, files are
// offered. Each is whole, and the invocation of `usage` is the program's name.

[[nodiscard]] std::string bash_completion(const Usage& usage);
[[nodiscard]] std::string fish_completion(const Usage& usage);
[[nodiscard]] std::string zsh_completion(const Usage& usage);

}  // namespace veneer::manual
