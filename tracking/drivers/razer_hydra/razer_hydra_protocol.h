// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <chrono>
#include <optional>

#include "tracking/device/protocol.h"

namespace veneer::tracking {

/// Razer Hydra: two magnetic controllers, sensors 1 and 2, about 250 reports a second without clock
/// or sequence number. A report is 52 bytes, with a block for each controller at 8 and at 30,
/// little-endian:
///
///     0 i16 x, y, z in mm   6 i16 w, x, y, z in 1/32768   14 buttons, sticks, trigger
///
/// The device starts as a game pad and has to be told to report motion; it may fall back at any
/// time, which shows in reports of another size. The frame is the base's turned by half a turn
/// about x, as other programs for the Hydra have it.
/// Source: the layout read by VRPN's Razer Hydra driver.
class RazerHydraProtocol final : public Protocol {
 public:
  static constexpr std::size_t kReportBytes = 52;

  /// @param hemisphere  a direction from the base, of any length, towards the half space in which
  ///   the controllers stay. The field of the base is the same at opposite points, so that the
  ///   device may take one for the other; without it the device is believed.
  explicit RazerHydraProtocol(std::optional<Eigen::Vector3d> hemisphere = {})
      : hemisphere_(hemisphere) {}

  [[nodiscard]] std::vector<Command> start() const override;
  [[nodiscard]] std::optional<DeviceClock> clock() const override { return std::nullopt; }
  [[nodiscard]] std::optional<WrappingCounter> sequence() const override { return std::nullopt; }
  [[nodiscard]] Duration period() const override { return std::chrono::milliseconds(4); }
  void reset() override { strange_run_ = 0; }
  /// @param report  one whole report.
  void feed(std::span<const std::byte> report,
            std::vector<RawSample>& samples,
            std::vector<std::byte>& reply) override;
  /// After several reports in a row that are not of motion.
  [[nodiscard]] bool wants_restart() const override { return strange_run_ >= kStrangeRun; }
  [[nodiscard]] ProtocolCounters counters() const override { return counters_; }

 private:
  /// One or two may be left over from before the change of mode.
  static constexpr int kStrangeRun = 8;
  std::optional<Eigen::Vector3d> hemisphere_;
  int strange_run_ = 0;
  ProtocolCounters counters_;
};

}  // namespace veneer::tracking
