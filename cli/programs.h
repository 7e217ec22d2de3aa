// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace veneer::cli {

/// Where this program lies, and the others beside it.
[[nodiscard]] std::filesystem::path program_folder();
/// The examples that are shipped: share/veneer beside the folder of an installed program, else the
/// project's folder etc, as build/bin/veneer lies two folders below the project.
[[nodiscard]] std::filesystem::path default_etc();
/// Runs a program beside this one and waits for it. Errors: kIo with its exit code.
[[nodiscard]] Status run_program(const std::string& name, std::vector<std::string> arguments);
/// Whether `file` was made after this program was built: what an older one made may differ.
[[nodiscard]] bool is_up_to_date(const std::filesystem::path& file);

}  // namespace veneer::cli
