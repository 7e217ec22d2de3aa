// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/polhemus.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "tracking/device/device_tracker.h"
#include "tracking/drivers/polhemus/fastrak_protocol.h"
#include "tracking/drivers/polhemus/polhemus_protocol.h"
#include "tracking/transports/usb_bulk.h"

namespace veneer::tracking {
namespace {

constexpr std::uint16_t kVendor = 0x0f44;

struct Model {
  std::string_view key;   ///< in TOML
  std::string_view name;  ///< for people
  std::unique_ptr<Protocol> (*make_protocol)();
  std::array<UsbModel, 2> usb;
};

constexpr std::array<UsbPipe, 2> bulk_in(std::uint8_t endpoint) {
  return {{{endpoint, UsbPipe::Kind::kBulk}, {}}};
}

template <PolhemusModel kModel>
std::unique_ptr<Protocol> make_tagged() {
  return std::make_unique<PolhemusProtocol>(kModel);
}

std::unique_ptr<Protocol> make_fastrak() { return std::make_unique<FastrakProtocol>(); }

/// It answers in bulk transfers, and sends continuous output in interrupt transfers.
constexpr std::array<UsbPipe, 2> kFastrakIn{
    {{0x82, UsbPipe::Kind::kBulk}, {0x84, UsbPipe::Kind::kInterrupt}}};

/// High speed, which loads its firmware, and the full-speed ones before it.
/// Source: numbers as in VRPN's and ROS's Polhemus drivers.
constexpr std::array kModels{
    Model{"liberty",
          "LIBERTY",
          &make_tagged<PolhemusModel::kLiberty>,
          {{{"LIBERTY HS", {kVendor, 0xff20}, 0xff21, 0x04, bulk_in(0x88)},
            {"LIBERTY", {kVendor, 0xff12}, 0xff11, 0x02, bulk_in(0x82)}}}},
    Model{"patriot",
          "PATRIOT",
          &make_tagged<PolhemusModel::kPatriot>,
          {{{"PATRIOT HS", {kVendor, 0xef20}, 0xef21, 0x04, bulk_in(0x88)},
            {"PATRIOT", {kVendor, 0xef12}, 0xef11, 0x02, bulk_in(0x82)}}}},
    Model{"fastrak",
          "FASTRAK",
          &make_fastrak,
          {{{"FASTRAK", {kVendor, 0x0002}, 0x0001, 0x02, kFastrakIn},
            {"FASTRAK", {kVendor, 0x0003}, 0, 0x02, kFastrakIn}}}},
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
                "opening the Polhemus tracker: no model is called \"{}\"; set model to "
                "\"liberty\", \"patriot\" or \"fastrak\"",
                key);
  }
  return std::make_unique<DeviceTracker>(
      std::make_unique<UsbBulkPort>(std::string(model->name),
                                    std::vector<UsbModel>(model->usb.begin(), model->usb.end()),
                                    std::move(identity),
                                    clock),
      model->make_protocol(),
      options,
      clock);
}

std::vector<UsbAppearance> polhemus_on_usb() {
  std::vector<UsbAppearance> result;
  for (const Model& model : kModels) {
    for (const UsbModel& usb : model.usb) {
      const std::string name = fmt::format("Polhemus {}", usb.name);
      result.push_back({name, usb.id, DeviceClass::kUsb, false});
      const UsbId boot{usb.id.vendor, usb.boot_product};
      if (usb.boot_product != 0) result.push_back({name, boot, DeviceClass::kUsb, true});
    }
  }
  return result;
}

}  // namespace veneer::tracking
