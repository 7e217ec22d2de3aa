// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/clock.h"
#include "service/bus/bus_address.h"
#include "service/control.h"

namespace veneer::service {

struct BusOptions {
  BusAddress address;
  /// Where the bus cannot be had at first, go on trying instead of failing.
  bool keep_trying = false;
  /// How often status() is asked: a change of state or faults is signalled within this.
  Duration poll = std::chrono::milliseconds(50);
  /// Everything else is signalled no more often than this.
  Duration figures = std::chrono::seconds(1);
  /// From one attempt to get onto the bus to the next: doubles from the first to the last.
  Duration first_retry = std::chrono::milliseconds(200);
  Duration last_retry = std::chrono::seconds(10);
};

/// veneerd on a message bus: its status as properties with signals of change, its commands as
/// methods (docs/howto/service.md). All happens on three threads of its own: one answers and asks
/// status(), one has commands done, one goes dark, so that what takes long holds up nothing. When
/// the bus goes away, it comes back with the bus; calls that were being done then are not answered.
class BusServer {
 public:
  /// @param control  borrowed; must outlive the server.
  /// Errors: kUnavailable (no such bus; it does not let us have the name; somebody has it).
  [[nodiscard]] static Result<std::unique_ptr<BusServer>> start(ServiceControl& control,
                                                                const BusOptions& options);
  /// Waits for the command that is being done.
  virtual ~BusServer() = default;
  /// Whether it can be reached now. Any thread.
  [[nodiscard]] virtual bool connected() const = 0;
};

}  // namespace veneer::service
