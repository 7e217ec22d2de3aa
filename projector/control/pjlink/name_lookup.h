// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include <functional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"

namespace veneer::projector::pjlink {

/// Where a stream may be connected to.
struct Endpoint {
  sockaddr_storage address{};
  socklen_t size = 0;
};

/// What getaddrinfo() gave: endpoints, or its error number.
struct LookedUp {
  int error = 0;
  std::vector<Endpoint> endpoints;
};

/// Looks a name up, for as long as the name servers take; that can be half a minute, and nothing
/// ends it. Called on a thread that nobody waits for: what it captures must live until it returns.
using Resolve = std::function<LookedUp(const std::string& host, int port)>;
/// As the system is set up to: getaddrinfo().
[[nodiscard]] LookedUp resolve_by_system(const std::string& host, int port);

/// The host and port, for texts: "192.0.2.7:4352", "[2001:db8::7]:4352".
[[nodiscard]] std::string place_of(const std::string& host, int port);

/// An address in numbers is taken at once and without `resolve`; a name is waited for until the
/// deadline (CLOCK_MONOTONIC), or until `stop` is readable. A look-up that was given up goes on
/// by itself; where several do, no further one is begun until one of them has ended.
/// Errors: kNotFound (no such name, or no answer), kUnavailable (too many hang), kCancelled.
[[nodiscard]] Result<std::vector<Endpoint>> look_up(
    const std::string& host, int port, Time deadline, int stop, const Resolve& resolve);

}  // namespace veneer::projector::pjlink
