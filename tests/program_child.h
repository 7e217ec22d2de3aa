// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <string>

#include "base/files.h"

// Veneer's programs as children of a test, which signals them or kills what they consist of.
namespace veneer {

/// Starts a shell's line, which begins with `exec` where signals are for its program. It ends when
/// the thread that called this does, so that nothing outlives a test that crashed.
[[nodiscard]] inline pid_t start_shell(const std::string& line) {
  const pid_t child = ::fork();
  VENEER_CHECK(child >= 0);
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);  // which mpirun passes on
    ::execl("/bin/sh", "sh", "-c", line.c_str(), static_cast<char*>(nullptr));
    ::_exit(127);
  }
  return child;
}

/// Starts `PROGRAM ARGUMENTS`, a shell's line, from the folder of the programs.
[[nodiscard]] inline pid_t start(const std::string& line) {
  return start_shell(fmt::format("exec {}/{} </dev/null", VENEER_PROGRAMS, line));
}

/// Its exit code once it has ended; 128 + n for signal n.
[[nodiscard]] inline int wait_for(pid_t child) {
  int status = 0;
  VENEER_CHECK(::waitpid(child, &status, 0) == child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace veneer
