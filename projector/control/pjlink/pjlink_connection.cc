// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/pjlink_connection.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "projector/control/pjlink/internal_wait.h"
#include "projector/control/pjlink/pjlink_protocol.h"

namespace veneer::projector::pjlink {
namespace {

/// 0 or an error number; EINPROGRESS where the deadline passed first, ECANCELED where somebody said
/// stop.
int connect_to(const Endpoint& to, Time deadline, int stop, UniqueFd& socket) {
  socket = UniqueFd(
      ::socket(to.address.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, IPPROTO_TCP));
  if (!socket) return errno;
  if (::connect(socket.value(), reinterpret_cast<const sockaddr*>(&to.address), to.size) == 0)
    return 0;
  if (errno != EINPROGRESS && errno != EINTR) return errno;
  const Wait waited = wait_for(socket.value(), POLLOUT, stop, deadline);
  if (waited != Wait::kReady) return waited == Wait::kStopped ? ECANCELED : EINPROGRESS;
  int error = 0;
  socklen_t size = sizeof(error);
  if (::getsockopt(socket.value(), SOL_SOCKET, SO_ERROR, &error, &size) != 0) return errno;
  return error;
}

tl::unexpected<Error> cancelled(const std::string& name) {
  return fail(Errc::kCancelled, "speaking with {}: it was interrupted", name);
}

tl::unexpected<Error> refusal(const std::string& name, int error) {
  if (error == ECANCELED) return cancelled(name);
  if (error == ECONNREFUSED)
    return fail(Errc::kNotFound,
                "connecting to {}: nobody listens there; switch PJLink (\"network control\") on in "
                "the projector's menu, and see that it is its address",
                name);
  if (error == EINPROGRESS || error == ETIMEDOUT || error == EHOSTUNREACH || error == ENETUNREACH)
    return fail(
        Errc::kNotFound,
        "connecting to {}: no answer; see to the network cable and the address. A projector "
        "in eco standby has its network off: set its standby mode to \"network\" or "
        "\"normal\", and switch it on by hand this once",
        name);
  return fail(Errc::kIo, "connecting to {}: {}", name, std::strerror(error));
}

tl::unexpected<Error> hung_up(const std::string& name) {
  return fail(Errc::kDisconnected,
              "speaking with {}: the projector hung up in the middle; try again, and see that no "
              "other program controls it",
              name);
}

tl::unexpected<Error> too_slow(const std::string& name, std::string_view begun) {
  return fail(Errc::kTimeout,
              "speaking with {}: no whole answer in time{}; try again, or raise time_limit_s",
              name,
              begun.empty() ? "" : fmt::format(" (it began \"{}\")", readable(begun)));
}

}  // namespace

Result<Connection> Connection::open(
    const std::string& host, int port, Time deadline, int stop, const Resolve& resolve) {
  const std::string name = place_of(host, port);
  VENEER_ASSIGN(const std::vector<Endpoint> endpoints,
                look_up(host, port, deadline, stop, resolve));
  int error = EHOSTUNREACH;  // where there is none
  for (const Endpoint& each : endpoints) {
    UniqueFd socket;
    error = connect_to(each, deadline, stop, socket);
    if (error == ECANCELED) break;
    if (error != 0) continue;
    const int on = 1;
    ::setsockopt(socket.value(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    return Connection(std::move(socket), stop, name);
  }
  return refusal(name, error);
}

Status Connection::write(std::string_view bytes, Time deadline) {
  while (!bytes.empty()) {
    const ssize_t count =
        ::send(socket_.value(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(count));
      continue;
    }
    if (errno == EINTR) continue;
    if (errno == ECONNRESET || errno == EPIPE || errno == ETIMEDOUT) return hung_up(name_);
    if (errno != EAGAIN && errno != EWOULDBLOCK)
      return fail(Errc::kIo, "speaking with {}: {}", name_, std::strerror(errno));
    const Wait waited = wait_for(socket_.value(), POLLOUT, stop_, deadline);
    if (waited == Wait::kStopped) return cancelled(name_);
    if (waited == Wait::kTooLate) return too_slow(name_, {});
  }
  return {};
}

Result<std::string> Connection::read_line(Time deadline) {
  while (true) {
    if (received_.starts_with('\n')) received_.erase(0, 1);
    const std::size_t end = received_.find('\r');
    if (std::min(end, received_.size()) > kLongestLine)
      return fail(Errc::kBadFormat,
                  "speaking with {}: a line without an end; is this the projector's PJLink port?",
                  name_);
    if (end != std::string::npos) {
      std::string line = received_.substr(0, end);
      received_.erase(0, end + 1);
      return line;
    }
    std::array<char, kLongestLine> buffer{};
    const ssize_t count = ::recv(socket_.value(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (count > 0) {
      received_.append(buffer.data(), static_cast<std::size_t>(count));
      // Whoever sends for ever, a byte at a time or all at once, is not listened to for ever.
      if (SteadyClock{}.now() > deadline && received_.find('\r') == std::string::npos)
        return too_slow(name_, received_);
      continue;
    }
    if (count == 0 || errno == ECONNRESET || errno == ETIMEDOUT) return hung_up(name_);
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK)
      return fail(Errc::kIo, "speaking with {}: {}", name_, std::strerror(errno));
    const Wait waited = wait_for(socket_.value(), POLLIN, stop_, deadline);
    if (waited == Wait::kStopped) return cancelled(name_);
    if (waited == Wait::kTooLate) return too_slow(name_, received_);
  }
}

bool Connection::has_news() const {
  return !(received_.empty() || received_ == "\n") ||
         wait_for(socket_.value(), POLLIN, stop_, SteadyClock{}.now()) == Wait::kReady;
}

}  // namespace veneer::projector::pjlink
