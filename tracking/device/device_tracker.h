// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/device/protocol.h"
#include "tracking/device/transport.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// Keys of the [tracker] table that every device has.
struct DeviceTrackerOptions {
  /// From the moment of measurement to the arrival of a sample. 0 to 1000.
  double latency_ms = 0;
  /// Reads the keys and records what is out of range.
  [[nodiscard]] static DeviceTrackerOptions read(TomlReader& toml);
};

/// A tracker that is a device: a port, and a protocol that says what comes out of it. Opens the
/// device, starts it, matches its clock to ours, and begins again whenever it is unplugged, falls
/// silent or fails; never gives up, never blocks for longer than asked, never sleeps but on the
/// clock.
class DeviceTracker final : public Tracker {
 public:
  /// Opens nothing yet: wait_pose() does.
  /// @param clock  borrowed; must outlive the tracker.
  DeviceTracker(std::unique_ptr<Port> port,
                std::unique_ptr<Protocol> protocol,
                const DeviceTrackerOptions& options,
                Clock& clock);

  [[nodiscard]] std::string description() const override;
  /// As Tracker says; never kDisconnected.
  [[nodiscard]] Result<PoseSample> wait_pose(Duration timeout) override;
  [[nodiscard]] TrackerStatus status() const override;

 private:
  std::unique_ptr<Port> port_;
  std::unique_ptr<Protocol> protocol_;
  DeviceTrackerOptions options_;
  Clock& clock_;
};

}  // namespace veneer::tracking
