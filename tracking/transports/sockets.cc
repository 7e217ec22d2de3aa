// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/sockets.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <ctime>

namespace veneer::tracking {

Result<Addresses> resolve(const std::string& host, int port, const addrinfo& hints) {
  addrinfo* list = nullptr;
  const int error = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &list);
  if (error != 0) return fail(Errc::kNotFound, "{}", ::gai_strerror(error));
  return Addresses(list);
}

std::string endpoint_name(const std::string& host, int port) {
  return host.find(':') == std::string::npos ? fmt::format("{}:{}", host, port)
                                             : fmt::format("[{}]:{}", host, port);
}

bool wait_for_events(int fd, short events, Time deadline) {
  while (true) {
    const Duration left = std::max(deadline - SteadyClock{}.now(), Duration{0});
    const auto whole_seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
    const timespec timeout{static_cast<time_t>(whole_seconds.count()),
                           static_cast<long>((left - whole_seconds).count())};
    pollfd entry{fd, events, 0};
    const int count = ::ppoll(&entry, 1, &timeout, nullptr);
    if (count > 0) return true;
    if (count == 0) return false;
    if (errno != EINTR) return true;  // the call that follows says what is wrong
  }
}

}  // namespace veneer::tracking
