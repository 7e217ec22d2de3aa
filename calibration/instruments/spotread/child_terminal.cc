// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/spotread/child_terminal.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <utility>

namespace veneer::calibration {
namespace {

/// Between two looks at whether the program has ended.
constexpr Duration kPollPeriod = std::chrono::milliseconds(20);

struct FileActions {
  posix_spawn_file_actions_t value;
  FileActions() { ::posix_spawn_file_actions_init(&value); }
  ~FileActions() { ::posix_spawn_file_actions_destroy(&value); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;
};

struct Attributes {
  posix_spawnattr_t value;
  Attributes() { ::posix_spawnattr_init(&value); }
  ~Attributes() { ::posix_spawnattr_destroy(&value); }
  Attributes(const Attributes&) = delete;
  Attributes& operator=(const Attributes&) = delete;
};

std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

std::string name_of(const std::string& addition) {
  return addition.substr(0, addition.find('=') + 1);
}

/// Ours, and what is added in the place of ours.
std::vector<std::string> environment_with(const std::vector<std::string>& additions) {
  std::vector<std::string> all = additions;
  for (char** each = environ; *each != nullptr; ++each) {
    const std::string_view variable = *each;
    const bool is_replaced = std::ranges::any_of(additions, [&](const std::string& addition) {
      return variable.starts_with(name_of(addition));
    });
    if (!is_replaced) all.emplace_back(variable);
  }
  return all;
}

int milliseconds_until(Time deadline, const Clock& clock) {
  using std::chrono::milliseconds;
  const auto left = std::chrono::ceil<milliseconds>(deadline - clock.now());
  return static_cast<int>(std::clamp(left, milliseconds(0), milliseconds(60000)).count());
}

}  // namespace

Result<ChildTerminal> ChildTerminal::start(const std::vector<std::string>& arguments,
                                           const std::vector<std::string>& environment) {
  VENEER_CHECK(!arguments.empty());
  const auto no_terminal = [&] {
    return fail(Errc::kIo,
                "starting {}: there is no terminal for it ({}); see that /dev/pts is mounted",
                arguments[0],
                std::strerror(errno));
  };
  UniqueFd terminal(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK));
  std::array<char, 64> name{};
  if (!terminal || ::grantpt(terminal.value()) != 0 || ::unlockpt(terminal.value()) != 0 ||
      ::ptsname_r(terminal.value(), name.data(), name.size()) != 0)
    return no_terminal();
  // Its side is held open until it has it, so that settings last.
  const UniqueFd its_side(::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  termios settings{};
  if (!its_side || ::tcgetattr(its_side.value(), &settings) != 0) return no_terminal();
  settings.c_lflag &= ~static_cast<tcflag_t>(ECHO);  // our own keys are not to come back
  settings.c_oflag &= ~static_cast<tcflag_t>(OPOST);
  if (::tcsetattr(its_side.value(), TCSANOW, &settings) != 0) return no_terminal();

  // A session of its own: the first terminal that it opens becomes the one it is controlled by, and
  // all that it starts can be ended together.
  FileActions actions;
  ::posix_spawn_file_actions_addopen(&actions.value, STDIN_FILENO, name.data(), O_RDWR, 0);
  ::posix_spawn_file_actions_adddup2(&actions.value, STDIN_FILENO, STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions.value, STDIN_FILENO, STDERR_FILENO);
  Attributes attributes;
  ::posix_spawnattr_setflags(
      &attributes.value,
      static_cast<short>(POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK));
  sigset_t signals;
  ::sigemptyset(&signals);
  ::posix_spawnattr_setsigmask(&attributes.value, &signals);
  for (const int signal : {SIGPIPE, SIGINT, SIGHUP, SIGTERM}) ::sigaddset(&signals, signal);
  ::posix_spawnattr_setsigdefault(&attributes.value, &signals);

  std::vector<std::string> words = arguments;
  std::vector<std::string> variables = environment_with(environment);
  pid_t process = -1;
  const int error = ::posix_spawnp(&process,
                                   words[0].c_str(),
                                   &actions.value,
                                   &attributes.value,
                                   pointers_to(words).data(),
                                   pointers_to(variables).data());
  if (error == ENOENT)
    return fail(Errc::kNotFound,
                "starting {}: there is no such program; install it (Debian: apt install argyll)",
                arguments[0]);
  if (error != 0)
    return fail(Errc::kIo,
                "starting {}: {}; see that it is a program that you may run",
                arguments[0],
                std::strerror(error));
  return ChildTerminal(process, std::move(terminal));
}

ChildTerminal::ChildTerminal(ChildTerminal&& other) noexcept
    : process_(std::exchange(other.process_, -1)),
      terminal_(std::move(other.terminal_)),
      wait_status_(other.wait_status_) {}

ChildTerminal::~ChildTerminal() { kill(); }

void ChildTerminal::kill() {
  if (process_ < 0) return;
  ::kill(-process_, SIGKILL);
  while (::waitpid(process_, &wait_status_, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
}

bool ChildTerminal::has_ended() {
  if (process_ < 0) return true;
  // Its group may outlive it; as long as it is not waited for, its number is not given out again.
  siginfo_t info{};
  if (::waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOHANG | WNOWAIT) != 0 ||
      info.si_pid == 0)
    return false;
  kill();
  return true;
}

Result<std::string> ChildTerminal::read(Time deadline, Clock& clock) {
  std::array<char, 4096> buffer{};
  for (;;) {
    pollfd ready{terminal_.value(), POLLIN, 0};
    // Not for longer than a while: what it started may hold the terminal open after its end.
    const int patience = std::min(milliseconds_until(deadline, clock),
                                  static_cast<int>(std::chrono::milliseconds(200).count()));
    ::poll(&ready, 1, patience);
    const ssize_t size = ::read(terminal_.value(), buffer.data(), buffer.size());
    if (size > 0) return std::string(buffer.data(), static_cast<std::size_t>(size));
    const bool would_wait = size < 0 && (errno == EAGAIN || errno == EINTR);
    if (!would_wait || has_ended())
      return fail(Errc::kDisconnected, "reading what a program prints: it has ended");
    if (clock.now() >= deadline)
      return fail(Errc::kTimeout, "reading what a program prints: it is silent");
  }
}

Status ChildTerminal::write(std::string_view keys) {
  while (!keys.empty()) {
    const ssize_t size = ::write(terminal_.value(), keys.data(), keys.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && errno == EAGAIN)
      return fail(Errc::kTimeout, "pressing a key of a program: it takes none");
    if (size < 0) return fail(Errc::kDisconnected, "pressing a key of a program: it has ended");
    keys.remove_prefix(static_cast<std::size_t>(size));
  }
  return {};
}

std::string ChildTerminal::finish(Time deadline, Clock& clock) {
  while (!has_ended()) {
    if (clock.now() >= deadline) {
      kill();
      return "had to be killed";
    }
    clock.sleep_until(std::min(deadline, clock.now() + kPollPeriod));
  }
  if (WIFSIGNALED(wait_status_))
    return fmt::format("was killed by signal {}", WTERMSIG(wait_status_));
  return fmt::format("ended with status {}", WEXITSTATUS(wait_status_));
}

std::optional<pid_t> ChildTerminal::process() const {
  return process_ < 0 ? std::nullopt : std::optional<pid_t>(process_);
}

}  // namespace veneer::calibration
