// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <chrono>

#include "tracking/device/protocol.h"

namespace veneer::tracking {

/// OSVR HDK: the head-mounted display's inertial sensor, sensor 1, 400 reports a second. It tells
/// where it looks and not where it is. A report is 16 or 32 bytes, little-endian:
///
///     0 low four bits: version, 1 to 3   1 sequence number   2 i16 x, y, z, w in 1/16384
///     10 i16 angular velocity in 1/512 rad/s, from version 2 on
///
/// Angular velocities are left to the filter, which treats all devices alike.
/// Source: the layout read by VRPN's OSVR driver.
class OsvrHdkProtocol final : public Protocol {
 public:
  /// @param position_m  where it stays.
  explicit OsvrHdkProtocol(const Eigen::Vector3d& position_m = Eigen::Vector3d::Zero())
      : position_m_(position_m) {}

  /// Nothing: it sends as long as it is plugged in.
  [[nodiscard]] std::vector<Command> start() const override { return {}; }
  [[nodiscard]] std::optional<DeviceClock> clock() const override { return std::nullopt; }
  [[nodiscard]] std::optional<WrappingCounter> sequence() const override {
    return WrappingCounter{8};
  }
  [[nodiscard]] Duration period() const override { return std::chrono::microseconds(2500); }
  void reset() override {}
  /// @param report  one whole report.
  void feed(std::span<const std::byte> report,
            std::vector<RawSample>& samples,
            std::vector<std::byte>& reply) override;
  [[nodiscard]] ProtocolCounters counters() const override { return counters_; }

 private:
  Eigen::Vector3d position_m_;
  ProtocolCounters counters_;
};

}  // namespace veneer::tracking
