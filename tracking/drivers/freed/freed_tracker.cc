// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/freed/freed_tracker.h"

#include "tracking/device/device_tracker.h"
#include "tracking/transports/udp.h"

namespace veneer::tracking {

FreedOptions FreedOptions::read(TomlReader& toml) {
  FreedOptions options;
  toml.read("address", options.address);
  toml.read("port", options.port);
  if (options.port < 1 || options.port > 65535) toml.add_error("port", "choose 1 to 65535");
  toml.read("rate_hz", options.rate_hz);
  if (!(options.rate_hz >= 1 && options.rate_hz <= 1000)) {
    toml.add_error("rate_hz", "choose 1 to 1000");
    options.rate_hz = 50;
  }
  std::string up = "y";
  toml.read("up", up);
  if (up != "y" && up != "z") toml.add_error("up", "choose \"y\" or \"z\"");
  options.up = up == "z" ? FreedProtocol::Up::kZ : FreedProtocol::Up::kY;
  return options;
}

Result<std::unique_ptr<Tracker>> open_freed(TomlReader& config, Clock& clock) {
  const FreedOptions options = FreedOptions::read(config);
  return std::make_unique<DeviceTracker>(
      std::make_unique<UdpPort>(options.address, options.port, clock),
      std::make_unique<FreedProtocol>(options.up, options.rate_hz),
      DeviceTrackerOptions::read(config),
      clock);
}

}  // namespace veneer::tracking
