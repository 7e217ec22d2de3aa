// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/hid.h"

#include <hidapi/hidapi.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "tracking/transports/internal_poll.h"

namespace veneer::tracking {
namespace {

struct CloseHid {
  void operator()(hid_device* device) const { hid_close(device); }
};
using HidHandle = std::unique_ptr<hid_device, CloseHid>;

const unsigned char* as_chars(std::span<const std::byte> bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

Result<HidHandle> open_node(const std::string& name,
                            const BusDevice& device,
                            std::string_view udev_rule) {
  HidHandle handle(hid_open_path(device.node.c_str()));
  if (handle) return handle;
  // hidapi tells a sentence, but no cause; the system does.
  const int error = ::access(device.node.c_str(), R_OK | W_OK) == 0 ? EIO : errno;
  return tl::unexpected<Error>(open_error(name, device, error, udev_rule));
}

/// The open device. Closed at its first failure: hidapi does not tell an unplug from anything else,
/// and a stale descriptor keeps the node's number taken.
class HidTransport final : public Transport {
 public:
  /// @param control  where feature reports go; null: to `data`.
  HidTransport(HidHandle data, HidHandle control, Clock& clock)
      : data_(std::move(data)), control_(std::move(control)), clock_(clock) {}

  [[nodiscard]] Received read(std::span<std::byte> buffer, Time deadline) override {
    int size = 0;
    do {
      if (!data_) return {IoStatus::kGone, 0, clock_.now()};
      size = hid_read_timeout(data_.get(),
                              reinterpret_cast<unsigned char*>(buffer.data()),
                              buffer.size(),
                              poll_milliseconds(deadline - clock_.now()));
      if (size < 0) close();
    } while (size < 0 || (size == 0 && clock_.now() < deadline));
    if (size == 0) return {IoStatus::kTimeout, 0, clock_.now()};
    return {IoStatus::kOk, static_cast<std::size_t>(size), clock_.now()};
  }

  // The kernel has a time limit of its own for what is written, 5 s; there is no other.
  [[nodiscard]] IoStatus write(std::span<const std::byte> bytes, Time /*deadline*/) override {
    if (!data_) return IoStatus::kGone;
    return sent(hid_write(data_.get(), as_chars(bytes), bytes.size()));
  }

  [[nodiscard]] IoStatus send_feature(std::span<const std::byte> bytes) override {
    if (!data_) return IoStatus::kGone;
    hid_device* const target = control_ ? control_.get() : data_.get();
    return sent(hid_send_feature_report(target, as_chars(bytes), bytes.size()));
  }

 private:
  [[nodiscard]] IoStatus sent(int size) {
    if (size >= 0) return IoStatus::kOk;
    close();
    return IoStatus::kGone;
  }
  void close() {
    data_.reset();
    control_.reset();
  }

  HidHandle data_;
  HidHandle control_;
  Clock& clock_;
};

}  // namespace

HidPort::HidPort(std::string name, HidModel model, UsbIdentity identity, Clock& clock)
    : name_(std::move(name)),
      model_(std::move(model)),
      identity_(std::move(identity)),
      clock_(clock),
      hotplug_(
          DeviceClass::kHidraw,
          [this](const BusDevice& device) {
            return is_wanted(device, model_.interface) ||
                   (model_.control_interface && is_wanted(device, *model_.control_interface));
          },
          clock) {
  static_cast<void>(hid_init());
}

bool HidPort::is_wanted(const BusDevice& device, int interface) const {
  return device.interface == interface && std::ranges::count(model_.ids, device.id) > 0;
}

std::string HidPort::description() const {
  std::string ids;
  for (const UsbId id : model_.ids) {
    if (opened_ && id != *opened_) continue;
    ids += fmt::format("{}{}", ids.empty() ? "" : " or ", text_of(id));
  }
  const std::string identity = identity_.text();
  return fmt::format("{} {}{}{}", name_, ids, identity.empty() ? "" : ", ", identity);
}

Result<std::unique_ptr<Transport>> HidPort::open() {
  hotplug_.forget();  // what has arrived by now is in the list
  VENEER_ASSIGN(const std::vector<BusDevice> devices, list_devices(DeviceClass::kHidraw));
  std::vector<BusDevice> candidates;
  for (const BusDevice& device : devices)
    if (is_wanted(device, model_.interface)) candidates.push_back(device);
  VENEER_ASSIGN(const BusDevice chosen, identity_.choose(description(), candidates));
  HidHandle control;
  if (model_.control_interface) {
    const auto partner = std::ranges::find_if(devices, [&](const BusDevice& device) {
      return device.usb_port == chosen.usb_port && is_wanted(device, *model_.control_interface);
    });
    if (partner == devices.end()) {
      return fail(Errc::kNotFound,
                  "opening {}: the interface that controls it is not there yet; plug it out and in "
                  "again if this lasts",
                  description());
    }
    VENEER_ASSIGN(control, open_node(name_, *partner, model_.udev_rule));
  }
  VENEER_ASSIGN(HidHandle data, open_node(name_, chosen, model_.udev_rule));
  identity_.remember(chosen);
  opened_ = chosen.id;
  return std::make_unique<HidTransport>(std::move(data), std::move(control), clock_);
}

}  // namespace veneer::tracking
