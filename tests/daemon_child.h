// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <iterator>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/files.h"

// veneerd as it is, run by a test.
namespace veneer {

/// Waits until `done`; false if that takes too long.
inline bool wait_until(const std::function<bool()>& done,
                       std::chrono::nanoseconds patience = std::chrono::seconds(30)) {
  const auto give_up = std::chrono::steady_clock::now() + patience;
  while (!done()) {
    if (std::chrono::steady_clock::now() > give_up) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

/// veneerd as a child; killed when it goes out of sight.
class Daemon {
 public:
  Daemon(const std::vector<std::string>& arguments, std::filesystem::path log)
      : log_(std::move(log)) {
    std::vector<std::string> words{VENEER_PROGRAMS "/veneerd"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    constexpr int kMode = 0644;
    ::posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_addopen(
        &actions, 2, log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, kMode);
    if (::posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ) != 0) pid_ = -1;
    ::posix_spawn_file_actions_destroy(&actions);
  }
  ~Daemon() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  [[nodiscard]] bool runs() const { return pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == 0; }
  /// Ends it as a person does; its exit code, or -1.
  [[nodiscard]] int stop() {
    ::kill(pid_, SIGTERM);
    int status = 0;
    const bool ended = wait_until([&] { return ::waitpid(pid_, &status, WNOHANG) == pid_; });
    if (!ended) return -1;
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] std::string log() const { return read_text(log_).value_or(""); }
  [[nodiscard]] std::size_t descriptors() const { return count_entries("fd"); }
  [[nodiscard]] std::size_t threads() const { return count_entries("task"); }
  [[nodiscard]] double resident_mib() const {
    const std::string status = read_text(proc() / "status").value_or("");
    const std::size_t at = status.find("VmRSS:");
    return at == std::string::npos ? 0 : std::stod(status.substr(at + 6)) / 1024;
  }

 private:
  [[nodiscard]] std::filesystem::path proc() const {
    return std::filesystem::path("/proc") / std::to_string(pid_);
  }
  [[nodiscard]] std::size_t count_entries(const char* folder) const {
    using std::filesystem::directory_iterator;
    return static_cast<std::size_t>(
        std::distance(directory_iterator(proc() / folder), directory_iterator()));
  }
  std::filesystem::path log_;
  pid_t pid_ = -1;
};

}  // namespace veneer
