// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"

namespace veneer::projector::pjlink {

struct FoundProjector {
  std::string address;  ///< in numbers, as `host` takes it
  std::string mac;      ///< "00:11:22:aa:bb:cc", by which it can be told from others
  bool operator==(const FoundProjector&) const = default;
};

struct SearchOptions {
  /// Who is asked: the broadcast address of a network, or one projector's. IPv4, in numbers.
  std::string address = "255.255.255.255";
  int port = 4352;
  Duration wait = std::chrono::seconds(3);  ///< for answers
  /// Errors: kInvalidOption.
  [[nodiscard]] Status check() const;
};

/// Asks all projectors of class 2 on the network to say that they are there (UDP). Those of class 1
/// do not answer, nor do those that have it switched off.
/// Sorted by address, each once. Errors: kInvalidOption, kUnavailable (no network), kIo.
[[nodiscard]] Result<std::vector<FoundProjector>> search(const SearchOptions& options);

}  // namespace veneer::projector::pjlink
