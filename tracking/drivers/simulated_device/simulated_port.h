// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/device/transport.h"
#include "tracking/drivers/simulated/path.h"
#include "tracking/drivers/simulated/pose_noise.h"
#include "tracking/drivers/simulated_device/fault_plan.h"

namespace veneer::tracking {

/// How the simulated device measures and sends; keys of the [tracker] table.
struct SimulatedDeviceOptions {
  PoseNoise noise{};
  std::uint64_t seed = 1;  ///< of noise, delays and faults
  /// From the moment of measurement to the arrival, at least. 0 to 1000.
  double delay_ms = 0;
  double jitter_ms = 0;           ///< mean of an exponential delay on top of it. 0 to 100
  double skew_ppm = 0;            ///< by which its clock runs slow. -1000 to 1000
  std::uint64_t first_count = 0;  ///< of its frame counter, which wraps at 2^32
  std::vector<Fault> faults;
  std::vector<Path> paths;  ///< one a body (station), 1 to 16
  /// Reads all of it. Errors: kInvalidOption (the paths); other mistakes are recorded in `toml`.
  [[nodiscard]] static Result<SimulatedDeviceOptions> read(TomlReader& toml);
};

/// A LIBERTY that is not there: frames of bodies on scripted paths as its bytes, 240 a second, at
/// the moments when they would arrive, with planned faults. It sends only after it was told to, as
/// the device does, so that all of a driver takes part. On a VirtualClock every run is the same.
/// The paths begin when the port is made.
class SimulatedPort final : public Port {
 public:
  /// @param clock  borrowed; must outlive the port and what it opens.
  SimulatedPort(SimulatedDeviceOptions options, Clock& clock);
  ~SimulatedPort() override;
  [[nodiscard]] std::string description() const override;
  [[nodiscard]] Result<std::unique_ptr<Transport>> open() override;
  [[nodiscard]] bool wait_for_arrival(Time deadline) override;

 private:
  class Device;
  class Connection;
  std::unique_ptr<Device> device_;
};

}  // namespace veneer::tracking
