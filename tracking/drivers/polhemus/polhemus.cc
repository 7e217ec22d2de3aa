// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/polhemus.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tracking/device/device_tracker.h"
#include "tracking/drivers/polhemus/polhemus_protocol.h"
#include "tracking/transports/usb_bulk.h"

namespace veneer::tracking {
namespace {

constexpr std::uint16_t kVendor = 0x0f44;

struct Model {
  std::string_view key;   ///< in TOML
  std::string_view name;  ///< for people
  PolhemusModel model;
  std::array<UsbModel, 2> usb;
};

constexpr std::array<UsbPipe, 2> bulk_in(std::uint8_t endpoint) {
  return {{{endpoint, UsbPipe::Kind::kBulk}, {}}};
}

/// High speed, which loads its firmware, and the full-speed ones before it.
/// Source: numbers as in VRPN's and ROS's Polhemus drivers.
constexpr std::array kModels{
    Model{"liberty",
          "LIBERTY",
          PolhemusModel::kLiberty,
          {{{"LIBERTY HS", {kVendor, 0xff20}, 0xff21, 0x04, bulk_in(0x88)},
            {"LIBERTY", {kVendor, 0xff12}, 0xff11, 0x02, bulk_in(0x82)}}}},
    Model{"patriot",
          "PATRIOT",
          PolhemusModel::kPatriot,
          {{{"PATRIOT HS", {kVendor, 0xef20}, 0xef21, 0x04, bulk_in(0x88)},
            {"PATRIOT", {kVendor, 0xef12}, 0xef11, 0x02, bulk_in(0x82)}}}},
};

}  // namespace

Result<std::unique_ptr<Tracker>> open_polhemus(TomlReader& config, Clock& clock) {
  const DeviceTrackerOptions options = DeviceTrackerOptions::read(config);
  UsbIdentity identity = UsbIdentity::read(config);
  std::string key(kModels.front().key);
  config.read("model", key);
  const auto model = std::ranges::find(kModels, key, &Model::key);
  if (model == kModels.end()) {
    return fail(Errc::kInvalidOption,
                "opening the Polhemus tracker: no model is called \"{}\"; set model to \"liberty\" "
                "or \"patriot\"",
                key);
  }
  return std::make_unique<DeviceTracker>(
      std::make_unique<UsbBulkPort>(std::string(model->name),
                                    std::vector<UsbModel>(model->usb.begin(), model->usb.end()),
                                    std::move(identity),
                                    clock),
      std::make_unique<PolhemusProtocol>(model->model),
      options,
      clock);
}

}  // namespace veneer::tracking
