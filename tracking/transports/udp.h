// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string>

#include "base/unique_handle.h"
#include "tracking/device/transport.h"
#include "tracking/transports/arrival_stamp.h"

namespace veneer::tracking {

/// A bound datagram socket. Hands out everything that has queued, in order, each datagram with the
/// moment at which the kernel received it. Sends nothing.
class UdpTransport final : public Transport {
 public:
  explicit UdpTransport(UniqueFd socket);
  /// kOverflow for a datagram that is longer than the buffer: it is dropped whole.
  [[nodiscard]] Received read(std::span<std::byte> buffer, Time deadline) override;
  [[nodiscard]] IoStatus write(std::span<const std::byte> bytes, Time deadline) override;

 private:
  /// kTimeout where none is there.
  [[nodiscard]] Received take(std::span<std::byte> buffer);
  UniqueFd socket_;
  ArrivalStamp stamps_;
};

/// A port of this machine that is listened at.
class UdpPort final : public Port {
 public:
  /// @param address  one of this machine's, in numbers; "0.0.0.0" or "::" for all of them.
  /// @param clock    borrowed; must outlive the port.
  UdpPort(std::string address, int port, Clock& clock);
  [[nodiscard]] std::string description() const override;
  [[nodiscard]] Result<std::unique_ptr<Transport>> open() override;
  /// Nobody says when an address appears or a port is let go: waits for the deadline.
  [[nodiscard]] bool wait_for_arrival(Time deadline) override;

 private:
  std::string address_;
  int port_;
  Clock& clock_;
};

}  // namespace veneer::tracking
