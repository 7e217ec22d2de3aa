// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/osvr_hdk/osvr_hdk.h"

#include <string>
#include <string_view>

#include "tracking/device/device_tracker.h"
#include "tracking/drivers/osvr_hdk/osvr_hdk_protocol.h"
#include "tracking/transports/hid.h"

namespace veneer::tracking {
namespace {

constexpr std::string_view kName = "OSVR HDK";
/// Early ones show the number of their microcontroller's maker.
const HidModel kModel{{{0x1532, 0x0b00}, {0x03eb, 0x2421}}, 0, std::nullopt};

}  // namespace

Result<std::unique_ptr<Tracker>> open_osvr_hdk(TomlReader& config, Clock& clock) {
  const DeviceTrackerOptions options = DeviceTrackerOptions::read(config);
  UsbIdentity identity = UsbIdentity::read(config);
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  config.read("position_m", position_m);
  if (!position_m.allFinite()) config.add_error("position_m", "not finite");
  return std::make_unique<DeviceTracker>(
      std::make_unique<HidPort>(std::string(kName), kModel, std::move(identity), clock),
      std::make_unique<OsvrHdkProtocol>(position_m),
      options,
      clock);
}

std::vector<UsbAppearance> osvr_hdk_on_usb() {
  std::vector<UsbAppearance> result;
  for (const UsbId id : kModel.ids)
    result.push_back({std::string(kName), id, DeviceClass::kHidraw, false});
  return result;
}

}  // namespace veneer::tracking
