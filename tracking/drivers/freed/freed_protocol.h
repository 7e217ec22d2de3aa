// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tracking/device/protocol.h"

namespace veneer::tracking {

/// FreeD, message type D1: the pose of a camera, sent by studio trackers and robotic heads. Sensor
/// n is camera n. There are neither time stamps nor sequence numbers.
///
/// FreeD's axes are right-handed: x and y level, z up, in millimetres. With all angles zero a
/// camera looks along +y with +x to its right. Pan turns it to the right (clockwise from above),
/// then tilt lifts its axis, then roll turns it clockwise as seen from behind, all in degrees. Out
/// of this come metres, and a body frame as everywhere in Veneer: +z forward, x right, y down. A
/// world with +y up has FreeD's x as x and FreeD's y as -z, so that at zero a camera looks along
/// -z; a world with +z up is FreeD's own.
///
/// Every datagram stands for itself and may hold several messages. The checksum is one byte, so
/// that a message is looked for at the next byte when it is wrong, and the rest of a datagram is
/// never joined to the next. Source: Vinten Radamec, "free-d Installation Manual" V1.4.4,
/// appendices A.3.2 and B.
class FreedProtocol final : public Protocol {
 public:
  enum class Up { kY, kZ };  ///< of the world
  /// @param rate_hz  how often a camera sends, as a rule. > 0.
  FreedProtocol(Up up, double rate_hz) : up_(up), rate_hz_(rate_hz) {}

  [[nodiscard]] std::vector<Command> start() const override { return {}; }
  [[nodiscard]] Recovery recovery() const override { return Recovery::kListen; }
  [[nodiscard]] std::optional<DeviceClock> clock() const override { return std::nullopt; }
  [[nodiscard]] std::optional<WrappingCounter> sequence() const override { return std::nullopt; }
  [[nodiscard]] Duration period() const override { return from_seconds(1 / rate_hz_); }
  void reset() override {}
  void feed(std::span<const std::byte> bytes,
            std::vector<RawSample>& samples,
            std::vector<std::byte>& reply) override;
  [[nodiscard]] ProtocolCounters counters() const override { return counters_; }

 private:
  Up up_;
  double rate_hz_;
  ProtocolCounters counters_;
};

}  // namespace veneer::tracking
