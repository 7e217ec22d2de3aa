// SPDX-License-Identifier: Apache-2.0
#include "cli/programs.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "base/exit_code.h"

namespace veneer::cli {

namespace fs = std::filesystem;

fs::path program_folder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

fs::path default_etc() {
  const fs::path installed = (program_folder() / "../share/veneer").lexically_normal();
  std::error_code error;
  if (fs::is_directory(installed, error)) return installed;
  return (program_folder() / "../../etc").lexically_normal();
}

Status run_program(const std::string& name, std::vector<std::string> arguments) {
  const std::string path = (program_folder() / name).string();
  arguments.insert(arguments.begin(), path);
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  pid_t pid = 0;
  if (const int error = ::posix_spawn(&pid, path.c_str(), nullptr, nullptr, argv.data(), environ);
      error != 0) {
    return fail(Errc::kIo, "starting {}: {}", path, std::strerror(error));
  }
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0) {
    if (errno != EINTR) return fail(Errc::kIo, "waiting for {}: {}", path, std::strerror(errno));
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != kExitDone) {
    return fail(Errc::kIo, "{} failed; what it says above tells why", name);
  }
  return {};
}

bool is_up_to_date(const fs::path& file) {
  std::error_code error;
  const auto made = fs::last_write_time(file, error);
  return !error && made > fs::last_write_time("/proc/self/exe");
}

}  // namespace veneer::cli
