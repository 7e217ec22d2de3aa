// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>

#include "base/clock.h"

namespace veneer::projector::pjlink {

enum class Wait { kReady, kTooLate, kStopped };

/// For one of `events` (or an error) on a descriptor, until the deadline, while nobody says stop.
inline Wait wait_for(int fd, short events, int stop, Time deadline) {
  while (true) {
    const Duration left = std::max(deadline - SteadyClock{}.now(), Duration{0});
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
    const timespec timeout{static_cast<time_t>(seconds.count()),
                           static_cast<long>((left - seconds).count())};
    std::array<pollfd, 2> entries{pollfd{fd, events, 0}, pollfd{stop, POLLIN, 0}};
    const int count = ::ppoll(entries.data(), entries.size(), &timeout, nullptr);
    if (count > 0 && entries[1].revents != 0) return Wait::kStopped;
    if (count >= 0) return count > 0 ? Wait::kReady : Wait::kTooLate;
    if (errno != EINTR) return Wait::kReady;  // the call that follows says what is wrong
  }
}

}  // namespace veneer::projector::pjlink
