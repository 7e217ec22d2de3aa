// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/vrpn/vrpn_tracker.h"

#include "tracking/device/device_tracker.h"
#include "tracking/drivers/vrpn/vrpn_protocol.h"
#include "tracking/transports/tcp.h"

namespace veneer::tracking {
namespace {

/// VRPN's own limit for a name, with the zero at its end.
constexpr std::size_t kLongestName = 99;

}  // namespace

VrpnOptions VrpnOptions::read(TomlReader& toml) {
  VrpnOptions options;
  toml.read("host", options.host);
  toml.read("port", options.port);
  if (options.port < 1 || options.port > 65535) toml.add_error("port", "choose 1 to 65535");
  toml.require("tracker", options.tracker);
  if (options.tracker.size() > kLongestName)
    toml.add_error("tracker", "a name has 99 letters at most");
  if (options.tracker.find('@') != std::string::npos)
    toml.add_error("tracker", "write what stands before the @ here, and the rest as host");
  toml.read("rate_hz", options.rate_hz);
  if (!(options.rate_hz >= 1 && options.rate_hz <= 10000)) {
    toml.add_error("rate_hz", "choose 1 to 10000");
    options.rate_hz = 100;
  }
  return options;
}

Result<std::unique_ptr<Tracker>> open_vrpn(TomlReader& config, Clock& clock) {
  const VrpnOptions options = VrpnOptions::read(config);
  return std::make_unique<DeviceTracker>(
      std::make_unique<TcpPort>(options.host, options.port, clock),
      std::make_unique<VrpnProtocol>(options.tracker, options.rate_hz),
      DeviceTrackerOptions::read(config),
      clock);
}

}  // namespace veneer::tracking
