// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "base/unique_handle.h"

// The other side of a network connection, for tests: written with bare sockets, apart from what it
// tests.
namespace veneer::tracking::loopback {

struct Address {
  sockaddr_storage storage{};
  socklen_t size = 0;
  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
  [[nodiscard]] sockaddr* get() { return reinterpret_cast<sockaddr*>(&storage); }
};

/// 127.0.0.1 or ::1.
inline Address address_of(int family, int port) {
  Address address;
  if (family == AF_INET6) {
    sockaddr_in6 v6{};
    v6.sin6_family = AF_INET6;
    v6.sin6_addr = in6addr_loopback;
    v6.sin6_port = htons(static_cast<std::uint16_t>(port));
    std::memcpy(&address.storage, &v6, sizeof(v6));
    address.size = sizeof(v6);
  } else {
    sockaddr_in v4{};
    v4.sin_family = AF_INET;
    v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    v4.sin_port = htons(static_cast<std::uint16_t>(port));
    std::memcpy(&address.storage, &v4, sizeof(v4));
    address.size = sizeof(v4);
  }
  return address;
}

/// A socket bound to the loopback address; empty where the machine has none of this family.
inline UniqueFd bound_socket(int type, int port = 0, int family = AF_INET) {
  UniqueFd fd(::socket(family, type | SOCK_CLOEXEC, 0));
  if (!fd) return fd;
  const int on = 1;
  if (type == SOCK_STREAM) ::setsockopt(fd.value(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  const Address address = address_of(family, port);
  if (::bind(fd.value(), address.get(), address.size) != 0) fd.reset();
  return fd;
}

inline int port_of(const UniqueFd& fd) {
  Address address;
  address.size = sizeof(address.storage);
  ::getsockname(fd.value(), address.get(), &address.size);
  // The port lies at the same place for both families.
  return ntohs(reinterpret_cast<const sockaddr_in*>(address.get())->sin_port);
}

/// A port that nobody uses at the moment.
inline int free_port(int type) { return port_of(bound_socket(type)); }

inline std::vector<std::byte> bytes_of(std::string_view text) {
  const auto view = std::as_bytes(std::span(text));
  return {view.begin(), view.end()};
}

inline bool send_datagram(int to_port, std::span<const std::byte> bytes) {
  const UniqueFd fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const Address to = address_of(AF_INET, to_port);
  return ::sendto(fd.value(), bytes.data(), bytes.size(), 0, to.get(), to.size) ==
         static_cast<ssize_t>(bytes.size());
}

}  // namespace veneer::tracking::loopback
