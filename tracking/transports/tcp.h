// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "base/unique_handle.h"
#include "tracking/device/transport.h"
#include "tracking/transports/sockets.h"

namespace veneer::tracking {

/// A connected stream socket. Bytes have arrived when they are read.
class TcpTransport final : public Transport {
 public:
  explicit TcpTransport(UniqueFd socket);
  [[nodiscard]] Received read(std::span<std::byte> buffer, Time deadline) override;
  /// kTimeout where nothing was sent; where only a part was, kIo: the stream is of no more use.
  [[nodiscard]] IoStatus write(std::span<const std::byte> bytes, Time deadline) override;

 private:
  UniqueFd socket_;
};

/// A server that is connected to.
///
/// open() waits for an answer for 50 ms only. A connection that takes longer goes on being made
/// behind it, for up to 5 s, and the open() that finds it made returns it: a slow network is no
/// reason to hold the thread.
class TcpPort final : public Port {
 public:
  /// @param host   a name or an IPv4 or IPv6 address. A name is looked up at every attempt until
  ///               one succeeds; that takes as long as the name server does.
  /// @param clock  borrowed; must outlive the port.
  TcpPort(std::string host, int port, Clock& clock);
  [[nodiscard]] std::string description() const override;
  [[nodiscard]] Result<std::unique_ptr<Transport>> open() override;
  /// Nobody says when a server comes up: waits for the deadline.
  [[nodiscard]] bool wait_for_arrival(Time deadline) override;

 private:
  /// Begins to connect to the address whose turn it is; the error number, or 0 (it may be
  /// unfinished).
  [[nodiscard]] int begin();
  /// The error number of the connection that was begun, 0 when it is made, EINPROGRESS when it is
  /// unfinished at `deadline`.
  [[nodiscard]] int outcome(Time deadline);
  void next_address();
  /// What an error number means to the one who reads it.
  [[nodiscard]] tl::unexpected<Error> refusal(int error) const;

  std::string host_;
  int port_;
  Clock& clock_;
  Addresses addresses_;
  const addrinfo* turn_ = nullptr;  // into addresses_
  UniqueFd pending_;                // being connected
  Time pending_since_;
};

}  // namespace veneer::tracking
