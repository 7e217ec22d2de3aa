// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "service/bus/bus_address.h"
#include "service/bus/command.h"
#include "service/status.h"

namespace veneer::service {

/// Asks and tells a running veneerd over the bus. One thread.
class BusClient {
 public:
  /// Errors: kUnavailable (no such bus).
  [[nodiscard]] static Result<BusClient> connect(const BusAddress& address);
  BusClient(BusClient&& other) noexcept;
  BusClient& operator=(BusClient&& other) noexcept;
  ~BusClient();

  /// Errors: kUnavailable (no service there), kTimeout, kBadFormat (another version).
  [[nodiscard]] Result<ServiceStatus> status();
  /// Returns when it is done; the path of the picture for Snapshot, else nothing.
  /// Errors: those of carry_out(), kUnavailable (no service there, or it is not for this user),
  /// kTimeout.
  [[nodiscard]] Result<std::string> tell(const Command& command);

 private:
  struct Impl;
  explicit BusClient(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace veneer::service
