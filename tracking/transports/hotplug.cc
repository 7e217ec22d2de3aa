// SPDX-License-Identifier: Apache-2.0
#include "tracking/transports/hotplug.h"

#include <poll.h>

#include <cerrno>
#include <chrono>
#include <string_view>
#include <utility>

#include "tracking/transports/internal_poll.h"
#include "tracking/transports/internal_udev.h"

namespace veneer::tracking {

struct HotplugMonitor::Monitor {
  UdevPtr<udev> context;
  UdevPtr<udev_monitor> events;
};

HotplugMonitor::HotplugMonitor(DeviceClass device_class, Wanted wanted, Clock& clock)
    : device_class_(device_class), wanted_(std::move(wanted)), clock_(clock) {
  auto monitor = std::make_unique<Monitor>();
  monitor->context.reset(udev_new());
  if (!monitor->context) return;
  // Of udevd rather than of the kernel: by then permissions are set.
  monitor->events.reset(udev_monitor_new_from_netlink(monitor->context.get(), "udev"));
  udev_monitor* const events = monitor->events.get();
  if (events == nullptr ||
      udev_monitor_filter_add_match_subsystem_devtype(
          events,
          subsystem_of(device_class),
          device_class == DeviceClass::kUsb ? "usb_device" : nullptr) < 0 ||
      udev_monitor_enable_receiving(events) < 0) {
    return;
  }
  monitor_ = std::move(monitor);
}

HotplugMonitor::~HotplugMonitor() = default;

void HotplugMonitor::forget() {
  while (arrived()) {
  }
}

bool HotplugMonitor::arrived() {
  if (!monitor_) return false;
  while (true) {
    errno = 0;
    const UdevPtr<udev_device> device(udev_monitor_receive_device(monitor_->events.get()));
    // Too much has happened to keep it all: something may have arrived.
    if (!device) return errno == ENOBUFS;
    const char* action = udev_device_get_action(device.get());
    if (action == nullptr || std::string_view(action) != "add") continue;
    const auto arrival = read_device(device.get(), device_class_);
    if (arrival && wanted_(*arrival)) return true;
  }
}

bool HotplugMonitor::wait_for_arrival(Time deadline) {
  while (!arrived()) {
    const Duration left = deadline - clock_.now();
    if (left <= Duration{}) return false;
    if (!monitor_) {
      clock_.sleep_until(deadline);
      return false;
    }
    pollfd poll_fd{udev_monitor_get_fd(monitor_->events.get()), POLLIN, 0};
    const int ready = ::poll(&poll_fd, 1, poll_milliseconds(left));
    if (ready == 0) clock_.sleep_until(deadline);  // which it is, unless time is virtual
    // An error on the descriptor would come back at once, for ever: sleep instead.
    if (ready > 0 && (poll_fd.revents & POLLIN) == 0) monitor_.reset();
  }
  return true;
}

}  // namespace veneer::tracking
