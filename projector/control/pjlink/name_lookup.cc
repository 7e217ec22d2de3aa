// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/name_lookup.h"

#include <netdb.h>
#include <sys/eventfd.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "base/unique_handle.h"
#include "projector/control/pjlink/internal_wait.h"

namespace veneer::projector::pjlink {
namespace {

/// Look-ups of which nobody has heard yet. A dead name server keeps each for half a minute, and a
/// projector is asked for again after a few seconds.
constexpr int kMostPending = 4;
std::atomic<int> pending{0};

/// Owned by the thread that looks up and by who waits for it, since either may end first.
struct Pending {
  UniqueFd done{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  std::mutex mutex;
  LookedUp answer;
};

struct FreeAddresses {
  void operator()(addrinfo* list) const noexcept { ::freeaddrinfo(list); }
};

LookedUp get_addresses(const std::string& host, int port, int flags) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICSERV | flags;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  LookedUp found;
  found.error = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &list);
  if (found.error != 0) return found;
  const std::unique_ptr<addrinfo, FreeAddresses> owner(list);
  for (const addrinfo* each = list; each != nullptr; each = each->ai_next) {
    Endpoint endpoint;
    if (each->ai_addrlen > sizeof(endpoint.address)) continue;
    std::memcpy(&endpoint.address, each->ai_addr, each->ai_addrlen);
    endpoint.size = each->ai_addrlen;
    found.endpoints.push_back(endpoint);
  }
  return found;
}

/// False where the machine has no thread left.
bool begin(const std::shared_ptr<Pending>& look_up,
           const std::string& host,
           int port,
           const Resolve& resolve) {
  try {
    std::thread([look_up, host, port, resolve] {
      LookedUp answer = resolve(host, port);
      {
        const std::lock_guard lock(look_up->mutex);
        look_up->answer = std::move(answer);
      }
      --pending;
      ::eventfd_write(look_up->done.value(), 1);
    }).detach();
  } catch (const std::system_error&) {
    return false;
  }
  return true;
}

}  // namespace

LookedUp resolve_by_system(const std::string& host, int port) {
  return get_addresses(host, port, 0);
}

std::string place_of(const std::string& host, int port) {
  return host.find(':') == std::string::npos ? fmt::format("{}:{}", host, port)
                                             : fmt::format("[{}]:{}", host, port);
}

Result<std::vector<Endpoint>> look_up(
    const std::string& host, int port, Time deadline, int stop, const Resolve& resolve) {
  LookedUp numbers = get_addresses(host, port, AI_NUMERICHOST);
  if (numbers.error == 0) return std::move(numbers.endpoints);
  const std::string place = place_of(host, port);
  const auto look_up = std::make_shared<Pending>();
  if (pending.fetch_add(1) >= kMostPending || !look_up->done ||
      !begin(look_up, host, port, resolve)) {
    --pending;
    return fail(
        Errc::kUnavailable,
        "connecting to {}: its name cannot be looked up, since earlier look-ups hang or the "
        "machine has no room left; see to the name server, or write the address in numbers",
        place);
  }
  switch (wait_for(look_up->done.value(), POLLIN, stop, deadline)) {
    case Wait::kStopped:
      return fail(Errc::kCancelled, "connecting to {}: it was interrupted", place);
    case Wait::kTooLate:
      return fail(Errc::kNotFound,
                  "connecting to {}: no answer from the name server; see to the network, or write "
                  "the address in numbers",
                  place);
    case Wait::kReady:
      break;
  }
  const std::lock_guard lock(look_up->mutex);
  if (look_up->answer.error != 0)
    return fail(Errc::kNotFound,
                "connecting to {}: {}; check the name, or write the address in numbers",
                place,
                ::gai_strerror(look_up->answer.error));
  return std::move(look_up->answer.endpoints);
}

}  // namespace veneer::projector::pjlink
