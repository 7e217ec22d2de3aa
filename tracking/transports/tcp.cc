// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/tcp.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace veneer::tracking {
namespace {

using namespace std::chrono_literals;

constexpr Duration kOpenPatience = 50ms;
/// After this the packets are taken to be lost, and another address or a new attempt is better.
constexpr Duration kConnectPatience = 5s;

IoStatus status_of(int error) {
  switch (error) {
    case ECONNRESET:
    case EPIPE:
    case ETIMEDOUT:
    case ENOTCONN:
      return IoStatus::kGone;
    default:
      return IoStatus::kIo;
  }
}

}  // namespace

TcpTransport::TcpTransport(UniqueFd socket) : socket_(std::move(socket)) {
  // An answer of a few bytes must not wait for more; where that cannot be had it comes later.
  const int on = 1;
  ::setsockopt(socket_.value(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
}

Received TcpTransport::read(std::span<std::byte> buffer, Time deadline) {
  while (true) {
    const ssize_t count = ::recv(socket_.value(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    const Time now = SteadyClock{}.now();
    if (count > 0) return {IoStatus::kOk, static_cast<std::size_t>(count), now};
    if (count == 0) return {IoStatus::kGone, 0, now};
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) return {status_of(errno), 0, now};
    if (!wait_for_events(socket_.value(), POLLIN, deadline)) return {IoStatus::kTimeout, 0, now};
  }
}

IoStatus TcpTransport::write(std::span<const std::byte> bytes, Time deadline) {
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t count = ::send(
        socket_.value(), bytes.data() + sent, bytes.size() - sent, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count >= 0) {
      sent += static_cast<std::size_t>(count);
      continue;
    }
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) return status_of(errno);
    if (!wait_for_events(socket_.value(), POLLOUT, deadline))
      return sent == 0 ? IoStatus::kTimeout : IoStatus::kIo;
  }
  return IoStatus::kOk;
}

TcpPort::TcpPort(std::string host, int port, Clock& clock)
    : host_(std::move(host)), port_(port), clock_(clock) {}

std::string TcpPort::description() const { return "TCP " + endpoint_name(host_, port_); }

Result<std::unique_ptr<Transport>> TcpPort::open() {
  const Time deadline = SteadyClock{}.now() + kOpenPatience;
  if (!addresses_) {
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICSERV;
    hints.ai_socktype = SOCK_STREAM;
    Result<Addresses> found = resolve(host_, port_, hints);
    if (!found) {
      return fail(Errc::kNotFound,
                  "connecting to {}: {}; check the name, or write the address in numbers",
                  description(),
                  found.error().what);
    }
    addresses_ = *std::move(found);
    turn_ = addresses_.get();
  }
  int error = 0;
  // Every address once; the one that does not answer is waited for.
  for (const addrinfo* each = addresses_.get(); each != nullptr; each = each->ai_next) {
    error = pending_ ? 0 : begin();
    if (error == 0) error = outcome(deadline);
    if (error == 0) return std::make_unique<TcpTransport>(std::exchange(pending_, UniqueFd{}));
    if (error == EINPROGRESS) break;
    pending_.reset();
    next_address();
  }
  if (error == EINPROGRESS && SteadyClock{}.now() - pending_since_ > kConnectPatience) {
    pending_.reset();
    next_address();
  }
  return refusal(error);
}

int TcpPort::begin() {
  pending_ = UniqueFd(
      ::socket(turn_->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, turn_->ai_protocol));
  if (!pending_) return errno;
  pending_since_ = SteadyClock{}.now();
  if (::connect(pending_.value(), turn_->ai_addr, turn_->ai_addrlen) == 0) return 0;
  return errno == EINPROGRESS || errno == EINTR ? 0 : errno;
}

int TcpPort::outcome(Time deadline) {
  if (!wait_for_events(pending_.value(), POLLOUT, deadline)) return EINPROGRESS;
  int error = 0;
  socklen_t size = sizeof(error);
  if (::getsockopt(pending_.value(), SOL_SOCKET, SO_ERROR, &error, &size) != 0) return errno;
  return error;
}

void TcpPort::next_address() {
  turn_ = turn_->ai_next == nullptr ? addresses_.get() : turn_->ai_next;
}

tl::unexpected<Error> TcpPort::refusal(int error) const {
  switch (error) {
    case ECONNREFUSED:
      return fail(Errc::kNotFound,
                  "connecting to {}: nobody listens there; is the server running?",
                  description());
    case EINPROGRESS:
    case ETIMEDOUT:
      return fail(Errc::kNotFound,
                  "connecting to {}: no answer so far; is the machine on, and does its firewall "
                  "let the port through?",
                  description());
    case ENETUNREACH:
    case EHOSTUNREACH:
    case EADDRNOTAVAIL:
      return fail(Errc::kNotFound,
                  "connecting to {}: there is no way there ({}); is the network plugged in?",
                  description(),
                  std::strerror(error));
    default:
      return fail(Errc::kIo, "connecting to {}: {}", description(), std::strerror(error));
  }
}

bool TcpPort::wait_for_arrival(Time deadline) {
  clock_.sleep_until(deadline);
  return false;
}

}  // namespace veneer::tracking
