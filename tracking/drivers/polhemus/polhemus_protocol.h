// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tracking/device/protocol.h"
#include "tracking/drivers/polhemus/internal_ascii.h"
#include "tracking/drivers/polhemus/polhemus_frame.h"

namespace veneer::tracking {

/// LIBERTY and PATRIOT, binary continuous output. Sensor n is station n, the frame of reference is
/// that of the transmitter (x forward, y right, z down as it is shipped), positions come in
/// centimetres and leave in metres. Sequence numbers are the frame count; ticks are too of a
/// LIBERTY, whose rate is known, and the milliseconds of a PATRIOT, whose rate is not relied on.
///
/// There is no checksum. A frame counts when tag, station, command and size are right: six bytes
/// that hardly ever stand so among others. When not, one byte is skipped, never more, so that no
/// true frame is lost to a false one. What follows is not looked at, since it would have to be
/// waited for. A run of readable text says that the device has reset itself and answers in ASCII.
class PolhemusProtocol final : public Protocol {
 public:
  explicit PolhemusProtocol(PolhemusModel model) : model_(model) {}

  [[nodiscard]] std::vector<Command> start() const override;
  [[nodiscard]] std::optional<DeviceClock> clock() const override;
  [[nodiscard]] std::optional<WrappingCounter> sequence() const override {
    return WrappingCounter{32};
  }
  [[nodiscard]] Duration period() const override;
  void reset() override;
  void feed(std::span<const std::byte> bytes,
            std::vector<RawSample>& samples,
            std::vector<std::byte>& reply) override;
  [[nodiscard]] bool wants_restart() const override { return text_.found(); }
  [[nodiscard]] ProtocolCounters counters() const override { return counters_; }

 private:
  PolhemusModel model_;
  std::vector<std::byte> pending_;  // the beginning of a frame
  TextRun text_;
  ProtocolCounters counters_;
};

}  // namespace veneer::tracking
