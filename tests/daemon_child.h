// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <iterator>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/files.h"
#include "base/unique_handle.h"

// veneerd as it is, run by a test.
namespace veneer {

/// Enough for a daemon to start or to stop even under a sanitizer.
inline constexpr auto kPatience = std::chrono::seconds(60);

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
    // Opened here: what a daemon before it said must not be read as this one's words.
    constexpr int kMode = 0644;
    const UniqueFd log_file(::open(log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kMode));
    const UniqueFd nothing(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    pid_ = ::fork();
    if (pid_ != 0) return;
    // Only what is safe after a fork.
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that crashed
    ::dup2(nothing.value(), STDIN_FILENO);
    ::dup2(log_file.value(), STDERR_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ~Daemon() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  [[nodiscard]] bool runs() const { return pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == 0; }
  void hang_up() const { ::kill(pid_, SIGHUP); }
  /// Ends it as a person does; its exit code, or -1.
  [[nodiscard]] int stop() {
    ::kill(pid_, SIGTERM);
    int status = 0;
    const bool ended =
        wait_until([&] { return ::waitpid(pid_, &status, WNOHANG) == pid_; }, kPatience);
    if (!ended) return -1;
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] std::string log() const { return read_text(log_).value_or(""); }
  /// Waits until the log says `what` so many times.
  [[nodiscard]] bool says(std::string_view what, int times = 1) const {
    const auto said = [&] {
      // Seldom, since frames that are late may be what the test counts.
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      const std::string text = log();
      int found = 0;
      for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1))
        ++found;
      return found >= times;
    };
    return wait_until(said, kPatience);
  }
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
