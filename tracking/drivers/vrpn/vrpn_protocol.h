// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "tracking/device/protocol.h"

namespace veneer::tracking {

/// The client's side of VRPN 07, for one tracker of one server: "vrpn_Tracker Pos_Quat" messages.
/// Sensor n is the tracker's sensor n; positions are in metres, the frame is the server's. Ticks
/// are the server's time stamps in microseconds: its wall clock, as a rule. There are no sequence
/// numbers.
///
/// Everything comes over the one TCP connection. A server would also send by UDP to a client that
/// named a port of its own; that gives up order and delivery for nothing on a local network, and no
/// firewall likes it, so no port is ever named.
///
/// Senders and types have numbers that hold for one connection only; they are matched by name, in
/// either direction. A stream of messages with lengths has no place to take it up again: when a
/// length is impossible, a description makes no sense or the server is of another version, the rest
/// is dropped and wants_restart() asks for a new connection.
/// Source: VRPN's Format_Of_Protocol.txt, and vrpn_Connection.C and vrpn_Tracker.C of VRPN 07.35.
class VrpnProtocol final : public Protocol {
 public:
  /// @param tracker  the name on the server: what stands before the @ in "Tracker0@host".
  /// @param rate_hz  how often a sensor sends, as a rule. > 0.
  VrpnProtocol(std::string tracker, double rate_hz)
      : tracker_(std::move(tracker)), rate_hz_(rate_hz) {}

  /// The greeting, and what the tracker and its messages are called by us.
  [[nodiscard]] std::vector<Command> start() const override;
  [[nodiscard]] Recovery recovery() const override { return Recovery::kAsk; }
  /// A ping: a server may be silent because nothing is in view.
  [[nodiscard]] std::vector<Command> restart() const override;
  [[nodiscard]] std::optional<DeviceClock> clock() const override {
    return DeviceClock{{64}, 1e-6};
  }
  [[nodiscard]] std::optional<WrappingCounter> sequence() const override { return std::nullopt; }
  [[nodiscard]] Duration period() const override { return from_seconds(1 / rate_hz_); }
  void reset() override;
  void feed(std::span<const std::byte> bytes,
            std::vector<RawSample>& samples,
            std::vector<std::byte>& reply) override;
  [[nodiscard]] bool wants_restart() const override { return agreed_.broken; }
  [[nodiscard]] ProtocolCounters counters() const override { return counters_; }

 private:
  using Bytes = std::span<const std::byte>;
  struct Header {
    std::uint32_t length = 0;  // of header and payload, without the padding
    std::uint32_t seconds = 0;
    std::uint32_t microseconds = 0;
    std::int32_t sender = 0;
    std::int32_t type = 0;
  };
  /// What was agreed on with this server.
  struct Agreement {
    bool greeted = false;
    bool broken = false;
    std::optional<std::int32_t> tracker;  // the server's number for it
    std::optional<std::int32_t> pose;
    std::optional<std::int32_t> ping;
  };

  [[nodiscard]] static Header header_of(Bytes message);
  /// Takes the greeting or message at the beginning of `bytes`; its length, or 0 where it is not
  /// complete or the stream is broken.
  std::size_t take(Bytes bytes, std::vector<RawSample>& samples, std::vector<std::byte>& reply);
  void take_message(const Header& header,
                    Bytes payload,
                    std::vector<RawSample>& samples,
                    std::vector<std::byte>& reply);
  void take_pose(const Header& header, Bytes payload, std::vector<RawSample>& samples);
  /// A sender or a type gets its number.
  void take_description(const Header& header, Bytes payload);
  std::size_t break_off();

  std::string tracker_;
  double rate_hz_;
  Agreement agreed_;
  std::vector<std::byte> pending_;  // the beginning of a message
  ProtocolCounters counters_;
};

}  // namespace veneer::tracking
