// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <netdb.h>
#include <sys/socket.h>

#include <memory>
#include <string>

#include "base/clock.h"
#include "base/result.h"

// What the sockets of UDP and TCP have in common.
namespace veneer::tracking {

struct FreeAddresses {
  void operator()(addrinfo* list) const noexcept { ::freeaddrinfo(list); }
};
/// A list of addresses to bind or to connect to, the preferred one first.
using Addresses = std::unique_ptr<addrinfo, FreeAddresses>;

/// Errors: kNotFound, with the resolver's reason.
[[nodiscard]] Result<Addresses> resolve(const std::string& host, int port, const addrinfo& hints);

/// "[::1]:3883" or "192.0.2.1:3883".
[[nodiscard]] std::string endpoint_name(const std::string& host, int port);

/// Waits until one of the poll() `events` holds at `fd` (an error or hang-up counts), or until
/// `deadline` on CLOCK_MONOTONIC. Whether it came; one that is there already is seen even when the
/// deadline has passed.
[[nodiscard]] bool wait_for_events(int fd, short events, Time deadline);

}  // namespace veneer::tracking
