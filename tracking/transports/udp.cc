// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/udp.h"

#include <poll.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "tracking/transports/sockets.h"

namespace veneer::tracking {
namespace {

std::optional<Duration> kernel_stamp(msghdr& message) {
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr;
       part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp{};
    std::memcpy(&stamp, CMSG_DATA(part), sizeof(stamp));
    return std::chrono::seconds(stamp.tv_sec) + std::chrono::nanoseconds(stamp.tv_nsec);
  }
  return std::nullopt;
}

}  // namespace

UdpTransport::UdpTransport(UniqueFd socket)
    : socket_(std::move(socket)), stamps_(SteadyClock{}.now()) {}

Received UdpTransport::read(std::span<std::byte> buffer, Time deadline) {
  while (true) {
    const Time asked = SteadyClock{}.now();
    const Received received = take(buffer);
    if (received.status != IoStatus::kTimeout) return received;
    stamps_.queue_was_empty(asked);
    if (!wait_for_events(socket_.value(), POLLIN, deadline)) return received;
  }
}

Received UdpTransport::take(std::span<std::byte> buffer) {
  iovec place{buffer.data(), buffer.size()};
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(timespec))> control{};
  msghdr message{};
  message.msg_iov = &place;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  ssize_t count = 0;
  do {
    count = ::recvmsg(socket_.value(), &message, MSG_DONTWAIT);
  } while (count < 0 && errno == EINTR);
  if (count < 0) {
    const bool nothing = errno == EAGAIN || errno == EWOULDBLOCK;
    return {nothing ? IoStatus::kTimeout : IoStatus::kIo, 0, {}};
  }
  const ClockPair now = ClockPair::now();
  const std::optional<Duration> stamp = kernel_stamp(message);
  const Time arrival = stamp ? stamps_.arrival(*stamp, now) : now.monotonic;
  if ((message.msg_flags & MSG_TRUNC) != 0) return {IoStatus::kOverflow, 0, arrival};
  return {IoStatus::kOk, static_cast<std::size_t>(count), arrival};
}

IoStatus UdpTransport::write(std::span<const std::byte>, Time) { return IoStatus::kIo; }

UdpPort::UdpPort(std::string address, int port, Clock& clock)
    : address_(std::move(address)), port_(port), clock_(clock) {}

std::string UdpPort::description() const { return "UDP " + endpoint_name(address_, port_); }

Result<std::unique_ptr<Transport>> UdpPort::open() {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
  hints.ai_socktype = SOCK_DGRAM;
  const Result<Addresses> addresses = resolve(address_, port_, hints);
  if (!addresses) {
    return fail(Errc::kUnavailable,
                "listening at {}: {}; write an address of this machine in numbers",
                description(),
                addresses.error().what);
  }
  const addrinfo& address = **addresses;
  UniqueFd socket(::socket(address.ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  // Without stamps of the kernel, the moment of reading has to do.
  if (socket) ::setsockopt(socket.value(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof(on));
  if (socket && ::bind(socket.value(), address.ai_addr, address.ai_addrlen) == 0)
    return std::make_unique<UdpTransport>(std::move(socket));
  switch (errno) {
    case EADDRINUSE:
      return fail(Errc::kUnavailable,
                  "listening at {}: another program does; `ss -ulpn sport = :{}` names it",
                  description(),
                  port_);
    case EADDRNOTAVAIL:
      return fail(Errc::kNotFound,
                  "listening at {}: this machine has no such address now; see `ip address`",
                  description());
    case EACCES:
      return fail(Errc::kUnavailable,
                  "listening at {}: ports below 1024 are for root; have it sent to a higher one",
                  description());
    default:
      return fail(Errc::kIo, "listening at {}: {}", description(), std::strerror(errno));
  }
}

bool UdpPort::wait_for_arrival(Time deadline) {
  clock_.sleep_until(deadline);
  return false;
}

}  // namespace veneer::tracking
