// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/razer_hydra/razer_hydra.h"

#include <string>
#include <string_view>

#include "tracking/device/device_tracker.h"
#include "tracking/drivers/razer_hydra/razer_hydra_protocol.h"
#include "tracking/transports/hid.h"

namespace veneer::tracking {
namespace {

constexpr std::string_view kName = "Razer Hydra";
/// Motion comes on interface 0; interface 1 is told to send it.
const HidModel kModel{{{0x1532, 0x0300}}, 0, 1};

}  // namespace

Result<std::unique_ptr<Tracker>> open_razer_hydra(TomlReader& config, Clock& clock) {
  const DeviceTrackerOptions options = DeviceTrackerOptions::read(config);
  UsbIdentity identity = UsbIdentity::read(config);
  std::optional<Eigen::Vector3d> hemisphere;
  if (config.contains("hemisphere"))
    config.read("hemisphere", hemisphere.emplace(Eigen::Vector3d::Zero()));
  if (hemisphere && !(hemisphere->norm() > 0 && hemisphere->allFinite()))
    config.add_error("hemisphere", "no direction; choose one such as [0, 0, 1]");
  return std::make_unique<DeviceTracker>(
      std::make_unique<HidPort>(std::string(kName), kModel, std::move(identity), clock),
      std::make_unique<RazerHydraProtocol>(hemisphere),
      options,
      clock);
}

std::vector<UsbAppearance> razer_hydra_on_usb() {
  std::vector<UsbAppearance> result;
  for (const UsbId id : kModel.ids)
    result.push_back({std::string(kName), id, DeviceClass::kHidraw, false});
  return result;
}

}  // namespace veneer::tracking
