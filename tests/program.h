// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <string>
#include <string_view>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

// Runs Veneer's programs as a person does.
namespace veneer {

struct Outcome {
  int exit_code = -1;  // 128 + n for signal n
  std::string out;     // standard output
  std::string err;     // standard error
};

/// Runs `PROGRAM ARGUMENTS`, a shell's line, from the folder of the programs.
inline Outcome run(const std::string& line) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const std::string err = (folder.path() / "err").string();
  const std::string command =
      fmt::format("exec {}/{} >{} 2>{} </dev/null", VENEER_PROGRAMS, line, out, err);
  const int status = std::system(command.c_str());
  Outcome outcome;
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  outcome.out = read_text(out).value_or("");
  outcome.err = read_text(err).value_or("");
  return outcome;
}

/// Whether it ended with this exit code and said this on standard error.
inline testing::AssertionResult fails(const Outcome& outcome,
                                      int exit_code,
                                      std::string_view message) {
  if (outcome.exit_code == exit_code && outcome.err.find(message) != std::string::npos) {
    return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << "expected exit code " << exit_code << " and \"" << message
                                     << "\", got " << outcome.exit_code << " and\n"
                                     << outcome.err;
}

}  // namespace veneer
