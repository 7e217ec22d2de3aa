// SPDX-License-Identifier: Apache-2.0
#include "capture/polarisers/elliptec/serial_port.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

namespace veneer::capture {
namespace {

std::string system_message(int error) {
  return std::error_code(error, std::generic_category()).message();
}

/// Waits for `events`; false where the deadline comes first.
bool wait_for(int fd, short events, Time deadline) {
  for (;;) {
    const Duration left = deadline - SteadyClock().now();
    const auto milliseconds = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    pollfd poll{fd, events, 0};
    const int ready =
        ::poll(&poll, 1, static_cast<int>(std::clamp<std::int64_t>(milliseconds, 0, 60000)));
    if (ready > 0) return true;
    if (ready < 0 && errno == EINTR) continue;
    if (left <= Duration{0}) return false;
  }
}

}  // namespace

Result<SerialPort> SerialPort::open(const std::filesystem::path& path) {
  const std::string doing = fmt::format("opening the serial port {}", path.string());
  // Not blocking: a modem's line may keep an open waiting for ever.
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!fd && errno == ENOENT)
    return fail(Errc::kNotFound,
                "{}: it is not there; plug the stage in, and see in /dev/serial/by-id what it is "
                "called",
                doing);
  if (!fd && errno == EACCES)
    return fail(Errc::kUnavailable,
                "{}: permission denied; add yourself to the group dialout (sudo adduser $USER "
                "dialout) and log in again",
                doing);
  if (!fd) return fail(Errc::kIo, "{}: {}", doing, system_message(errno));
  termios settings{};
  if (::tcgetattr(fd.value(), &settings) != 0)
    return fail(Errc::kInvalidOption, "{}: it is no serial port", doing);
  if (::flock(fd.value(), LOCK_EX | LOCK_NB) != 0)
    return fail(Errc::kUnavailable, "{}: another program has it open; end that one", doing);
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  if (::cfsetspeed(&settings, B9600) != 0 || ::tcsetattr(fd.value(), TCSANOW, &settings) != 0)
    return fail(Errc::kIo, "{}: setting 9600 baud: {}", doing, system_message(errno));
  return SerialPort(path, std::move(fd));
}

Status SerialPort::send(std::string_view bytes) {
  come_.clear();
  (void)::tcflush(fd_.value(), TCIFLUSH);
  const Time deadline = SteadyClock().now() + std::chrono::seconds(2);
  while (!bytes.empty()) {
    if (!wait_for(fd_.value(), POLLOUT, deadline))
      return fail(Errc::kTimeout, "{} takes nothing", path_.string());
    const ssize_t count = ::write(fd_.value(), bytes.data(), bytes.size());
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (count <= 0)
      return fail(Errc::kDisconnected,
                  "{} is gone ({}); plug it in again",
                  path_.string(),
                  system_message(errno));
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return {};
}

Result<std::string> SerialPort::read_line(Time deadline) {
  constexpr std::size_t kLongest = 256;
  for (;;) {
    if (const std::size_t end = come_.find('\n'); end != std::string::npos) {
      std::string line = come_.substr(0, end);
      come_.erase(0, end + 1);
      if (line.ends_with('\r')) line.pop_back();
      return line;
    }
    if (come_.size() > kLongest) {
      come_.clear();
      return fail(Errc::kBadFormat, "{}: bytes without an end of a line", path_.string());
    }
    if (!wait_for(fd_.value(), POLLIN, deadline))
      return fail(Errc::kTimeout, "no answer on {}", path_.string());
    std::array<char, 64> bytes;
    const ssize_t count = ::read(fd_.value(), bytes.data(), bytes.size());
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    // Ready and nothing to read: the other side hung up.
    if (count <= 0)
      return fail(Errc::kDisconnected, "{} is gone; plug it in again", path_.string());
    come_.append(bytes.data(), static_cast<std::size_t>(count));
  }
}

}  // namespace veneer::capture
