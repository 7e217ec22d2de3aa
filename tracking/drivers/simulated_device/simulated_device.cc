// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated_device/simulated_device.h"

#include "tracking/device/device_tracker.h"
#include "tracking/drivers/polhemus/polhemus_protocol.h"
#include "tracking/drivers/simulated_device/simulated_port.h"

namespace veneer::tracking {

Result<std::unique_ptr<Tracker>> open_simulated_device(TomlReader& config, Clock& clock) {
  const DeviceTrackerOptions tracker = DeviceTrackerOptions::read(config);
  VENEER_ASSIGN(SimulatedDeviceOptions device, SimulatedDeviceOptions::read(config));
  return std::make_unique<DeviceTracker>(
      std::make_unique<SimulatedPort>(std::move(device), clock),
      std::make_unique<PolhemusProtocol>(PolhemusModel::kLiberty),
      tracker,
      clock);
}

}  // namespace veneer::tracking
