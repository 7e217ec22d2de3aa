// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/usb_bulk.h"

#include <algorithm>
#include <utility>

#include "tracking/transports/internal_usb_transport.h"

namespace veneer::tracking {

UsbBulkPort::UsbBulkPort(std::string name,
                         std::vector<UsbModel> models,
                         UsbIdentity identity,
                         Clock& clock)
    : name_(std::move(name)),
      models_(std::move(models)),
      identity_(std::move(identity)),
      clock_(clock),
      hotplug_(
          DeviceClass::kUsb,
          [this](const BusDevice& device) {
            return model_of(device.id) != nullptr || model_without_firmware(device.id) != nullptr;
          },
          clock) {}

const UsbModel* UsbBulkPort::model_of(UsbId id) const {
  const auto model = std::ranges::find(models_, id, &UsbModel::id);
  return model != models_.end() ? &*model : nullptr;
}

const UsbModel* UsbBulkPort::model_without_firmware(UsbId id) const {
  const auto model = std::ranges::find_if(models_, [id](const UsbModel& each) {
    return each.boot_product != 0 && id == UsbId{each.id.vendor, each.boot_product};
  });
  return model != models_.end() ? &*model : nullptr;
}

std::string UsbBulkPort::description() const {
  std::string ids;
  for (const UsbModel& model : models_) {
    if (opened_ && model.id != *opened_) continue;
    ids += fmt::format("{}{}", ids.empty() ? "" : " or ", text_of(model.id));
  }
  const std::string identity = identity_.text();
  return fmt::format("{} {}{}{}", name_, ids, identity.empty() ? "" : ", ", identity);
}

Result<std::unique_ptr<Transport>> UsbBulkPort::open() {
  hotplug_.forget();  // what has arrived by now is in the list
  VENEER_ASSIGN(const std::vector<BusDevice> devices, list_devices(DeviceClass::kUsb));
  std::vector<BusDevice> candidates;
  for (const BusDevice& device : devices)
    if (model_of(device.id) != nullptr) candidates.push_back(device);
  const Result<BusDevice> chosen = identity_.choose(description(), candidates);
  if (!chosen) {
    const auto bare = std::ranges::find_if(devices, [this](const BusDevice& device) {
      return model_without_firmware(device.id) != nullptr;
    });
    if (chosen.error().code != Errc::kNotFound || bare == devices.end())
      return tl::unexpected<Error>(chosen.error());
    return tl::unexpected<Error>(firmware_error(name_, *bare));
  }
  const UsbModel& model = *model_of(chosen->id);
  VENEER_ASSIGN(std::unique_ptr<Transport> transport,
                UsbTransport::open(std::string(model.name), *chosen, model, clock_));
  identity_.remember(*chosen);
  opened_ = chosen->id;
  return transport;
}

}  // namespace veneer::tracking
