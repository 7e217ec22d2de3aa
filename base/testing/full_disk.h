// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace veneer {

/// Does `work` in a child process none of whose files may grow beyond a limit, which is what a full
/// disk does to a write: the call fails, or writes less than it was given.
/// @param work  returns the child's exit status, under 250.
/// @return that status; -1 where the child did not come to its end.
template <class Work>
[[nodiscard]] int on_full_disk(rlim_t most_bytes, const Work& work) {
  constexpr int kNoLimit = 250;
  const pid_t child = ::fork();
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that crashed
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{most_bytes, most_bytes};
    ::_exit(::setrlimit(RLIMIT_FSIZE, &limit) == 0 ? work() : kNoLimit);
  }
  int status = 0;
  if (child < 0 || ::waitpid(child, &status, 0) != child || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status) == kNoLimit ? -1 : WEXITSTATUS(status);
}

}  // namespace veneer
