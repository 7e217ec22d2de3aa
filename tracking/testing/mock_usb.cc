// SPDX-License-Identifier: Apache-2.0
#include "tracking/testing/mock_usb.h"

#include <fmt/format.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <memory>
#include <utility>

#include "base/result.h"

namespace veneer::tracking::mock {
namespace {

constexpr auto kPatience = std::chrono::seconds(1);
/// A node here is a plain file, which poll() always calls ready, so that libusb would ask for
/// finished transfers without end. Its question is held for so long instead, or until there is one.
constexpr gint64 kHold_us = 2000;
constexpr int kAnswered = 0;  // an errno otherwise
constexpr int kAnswersLater = -1;

constexpr std::uint8_t kIn = 0x80;

struct Unref {
  template <class T>
  void operator()(T* object) const {
    g_object_unref(object);
  }
};
using Data = std::unique_ptr<UMockdevIoctlData, Unref>;

/// The memory of the caller that `offset` in `data` points to.
Data resolve(UMockdevIoctlData* data, std::size_t offset, std::size_t size) {
  return Data(umockdev_ioctl_data_resolve(data, offset, size, nullptr));
}

template <class T>
void put(UMockdevIoctlData* data, const T& value) {
  std::memcpy(data->data, &value, sizeof(T));
}

}  // namespace

/// A transfer that the caller has submitted: its urb and its buffer, both in the caller's memory.
struct UsbDevice::Transfer {
  UMockdevIoctlClient* client;
  Data urb;
  Data buffer;
  int error = 0;
  Bytes bytes;
  [[nodiscard]] usbdevfs_urb& fields() const { return *reinterpret_cast<usbdevfs_urb*>(urb->data); }
};

/// A question for finished transfers that is not answered yet.
struct UsbDevice::Held {
  UsbDevice* device;
  UMockdevIoctlClient* client;  // null once it was answered
};

UsbDevice::UsbDevice(UsbDescription description, OnWrite on_write)
    : description_(std::move(description)),
      on_write_(std::move(on_write)),
      handler_(umockdev_ioctl_base_new()) {
  g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(&UsbDevice::on_ioctl), this);
  g_signal_connect(handler_, "client-connected", G_CALLBACK(&UsbDevice::on_connected), this);
}

UsbDevice::~UsbDevice() {
  if (is_plugged()) unplug();
  VENEER_CHECK(wait_until_closed());
  g_object_unref(handler_);
}

std::string UsbDevice::node() const {
  const int bus = std::stoi(description_.usb_port);
  return fmt::format("/dev/bus/usb/{:03}/{:03}", bus, number_);
}

std::string UsbDevice::syspath() const {
  const std::string& port = description_.usb_port;
  return fmt::format("/sys/devices/pci0000:00/0000:00:14.0/usb{}/{}", std::stoi(port), port);
}

Bytes UsbDevice::descriptors() const {
  std::vector<unsigned> d;
  const auto word = [](unsigned value) { return std::array{value & 0xFFU, value >> 8U}; };
  const auto append = [&d](auto... values) { (d.push_back(static_cast<unsigned>(values)), ...); };
  const auto vendor = word(description_.vendor);
  const auto product = word(description_.product);
  const unsigned serial = description_.serial.empty() ? 0 : 3;
  append(18, 1, 0, 2, 0xFF, 0, 0, 64, vendor[0], vendor[1], product[0], product[1], 0, 1, 1, 2);
  append(serial, 1);
  const auto total = word(static_cast<unsigned>(18 + 7 * description_.endpoints.size()));
  append(9, 2, total[0], total[1], 1, 1, 0, 0x80, 50);
  append(9, 4, 0, 0, description_.endpoints.size(), 0xFF, 0, 0, 0);
  for (const UsbEndpoint& endpoint : description_.endpoints)
    append(7, 5, endpoint.address, endpoint.interrupt ? 3 : 2, 0, 2, endpoint.interrupt ? 1 : 0);
  Bytes bytes;
  for (const unsigned value : d) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

std::string UsbDevice::description_text() const {
  const UsbDescription& d = description_;
  const int bus = std::stoi(d.usb_port);
  std::string hex;
  for (const std::byte byte : descriptors())
    hex += fmt::format("{:02X}", std::to_integer<unsigned>(byte));
  std::string text = fmt::format("P: {}\nN: {}={}\n",
                                 syspath().substr(std::strlen("/sys")),
                                 node().substr(std::strlen("/dev/")),
                                 hex);
  text += fmt::format(
      "E: DEVNAME={}\nE: DEVTYPE=usb_device\nE: DRIVER=usb\nE: SUBSYSTEM=usb\nE: BUSNUM={:03}\n"
      "E: DEVNUM={:03}\nE: MAJOR=189\nE: MINOR={}\nE: PRODUCT={:x}/{:x}/100\n",
      node(),
      bus,
      number_,
      (bus - 1) * 128 + number_ - 1,
      d.vendor,
      d.product);
  const auto attribute = [&text](const char* name, const std::string& value) {
    text += fmt::format("A: {}={}\\n\n", name, value);
  };
  attribute("busnum", std::to_string(bus));
  attribute("devnum", std::to_string(number_));
  attribute("speed", "480");
  attribute("bConfigurationValue", "1");
  attribute("bNumConfigurations", "1");
  attribute("idVendor", fmt::format("{:04x}", d.vendor));
  attribute("idProduct", fmt::format("{:04x}", d.product));
  attribute("product", d.name);
  if (!d.serial.empty()) attribute("serial", d.serial);
  text += fmt::format("H: descriptors={}\n", hex);
  return text;
}

void UsbDevice::plug() {
  static std::atomic<int> next_number{2};
  VENEER_CHECK(!is_plugged());
  number_ = next_number++ % 127 + 1;
  {
    const std::lock_guard lock(mutex_);
    plugged_ = true;
    packets_.clear();
  }
  Bus& bus = Bus::instance();
  // In this order: umockdev ends a program that opens a node whose socket is bound and does not yet
  // listen, and what is not there cannot be opened.
  bus.attach(node(), handler_);
  attached_ = true;
  bus.add(description_text());
  bus.announce(syspath(), "add");
}

void UsbDevice::unplug() {
  {
    const std::lock_guard lock(mutex_);
    VENEER_CHECK(plugged_);
    plugged_ = false;
    packets_.clear();
    while (!pending_.empty()) finish(pending_.begin(), ESHUTDOWN, {});
    while (!held_.empty()) wake(held_.begin()->first);
  }
  Bus& bus = Bus::instance();
  bus.announce(syspath(), "remove");
  if (std::exchange(attached_, false)) bus.detach(node());
  bus.remove(syspath());
}

bool UsbDevice::is_plugged() const {
  const std::lock_guard lock(mutex_);
  return plugged_;
}

void UsbDevice::send(std::uint8_t endpoint, Bytes bytes) {
  const std::lock_guard lock(mutex_);
  deliver({endpoint, 0, std::move(bytes)});
}

void UsbDevice::fail_transfer(std::uint8_t endpoint, int error) {
  const std::lock_guard lock(mutex_);
  deliver({endpoint, error, {}});
}

void UsbDevice::flush() {
  const std::lock_guard lock(mutex_);
  packets_.clear();
}

void UsbDevice::refuse_submits(int count, int error) {
  const std::lock_guard lock(mutex_);
  refused_submits_ = count;
  submit_error_ = error;
}

void UsbDevice::refuse_claims(int error) {
  const std::lock_guard lock(mutex_);
  claim_error_ = error;
}

void UsbDevice::forbid_opening() {
  namespace fs = std::filesystem;
  Bus& bus = Bus::instance();
  // umockdev talks to the handler even when the file cannot be opened, and never lets go again.
  if (std::exchange(attached_, false)) bus.detach(node());
  // All of the mocked tree is open to root alone, which is not what is to be tested.
  fs::permissions(bus.root(), fs::perms::all);
  for (const auto& entry : fs::recursive_directory_iterator(bus.root()))
    if (!entry.is_symlink()) fs::permissions(entry, fs::perms::all);
  fs::permissions(bus.root() + node(), fs::perms::none);
}

void UsbDevice::bind_kernel_driver(bool bound) {
  const std::lock_guard lock(mutex_);
  driver_bound_ = bound;
}

bool UsbDevice::has_kernel_driver() const {
  const std::lock_guard lock(mutex_);
  return driver_bound_;
}

bool UsbDevice::wait_for_reads_in_flight(std::size_t count) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, kPatience, [&] { return pending_.size() == count; });
}

std::size_t UsbDevice::in_flight() const {
  const std::lock_guard lock(mutex_);
  return pending_.size();
}

int UsbDevice::openers() const {
  const std::lock_guard lock(mutex_);
  return openers_;
}

bool UsbDevice::wait_until_closed() {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, kPatience, [&] { return openers_ == 0 && timers_ == 0; });
}

void UsbDevice::deliver(Packet packet) {
  if (!plugged_) return;
  const auto waiting = std::ranges::find_if(pending_, [&](const Transfer& transfer) {
    return transfer.fields().endpoint == packet.endpoint;
  });
  if (waiting == pending_.end()) {
    packets_.push_back(std::move(packet));
  } else {
    finish(waiting, packet.error, std::move(packet.bytes));
  }
}

void UsbDevice::finish(std::list<Transfer>::iterator transfer, int error, Bytes bytes) {
  transfer->error = error;
  transfer->bytes = std::move(bytes);
  UMockdevIoctlClient* const client = transfer->client;
  done_.splice(done_.end(), pending_, transfer);
  changed_.notify_all();
  wake(client);
}

void UsbDevice::on_connected(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto& device = *static_cast<UsbDevice*>(self);
  const std::lock_guard lock(device.mutex_);
  ++device.openers_;
  // umockdev has a signal for this, but does not send it when the caller closes between two calls.
  g_object_weak_ref(G_OBJECT(client), &UsbDevice::on_vanished, self);
}

/// The caller has closed the device, or has died.
void UsbDevice::on_vanished(gpointer self, GObject* client) {
  auto& device = *static_cast<UsbDevice*>(self);
  const std::lock_guard lock(device.mutex_);
  const auto is_theirs = [client](const Transfer& each) {
    return static_cast<void*>(each.client) == client;
  };
  std::erase_if(device.pending_, is_theirs);
  std::erase_if(device.done_, is_theirs);
  --device.openers_;
  device.changed_.notify_all();
}

gboolean UsbDevice::on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto& device = *static_cast<UsbDevice*>(self);
  ++device.ioctls_;
  const std::lock_guard lock(device.mutex_);
  const int outcome = device.ioctl(client, umockdev_ioctl_client_get_request(client));
  if (outcome != kAnswersLater)
    umockdev_ioctl_client_complete(client, outcome == kAnswered ? 0 : -1, outcome);
  return TRUE;
}

int UsbDevice::ioctl(UMockdevIoctlClient* client, unsigned long request) {
  UMockdevIoctlData* const argument = umockdev_ioctl_client_get_arg(client);
  // Only what was submitted before is to be had of a device that is gone.
  if (!plugged_ && request != USBDEVFS_REAPURB && request != USBDEVFS_REAPURBNDELAY) return ENODEV;
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES: {
      const Data data = resolve(argument, 0, sizeof(std::uint32_t));
      put<std::uint32_t>(data.get(),
                         USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                             USBDEVFS_CAP_REAP_AFTER_DISCONNECT);
      return kAnswered;
    }
    case USBDEVFS_CONNECTINFO: {
      const Data data = resolve(argument, 0, sizeof(usbdevfs_connectinfo));
      put(data.get(), usbdevfs_connectinfo{static_cast<unsigned>(number_), 0});
      return kAnswered;
    }
    case USBDEVFS_DISCONNECT_CLAIM:
      if (claim_error_ == 0) driver_bound_ = false;
      return claim_error_;
    case USBDEVFS_CLAIMINTERFACE:
      return driver_bound_ ? EBUSY : claim_error_;
    case USBDEVFS_CLEAR_HALT:
      ++cleared_halts_;
      return kAnswered;
    case USBDEVFS_RELEASEINTERFACE:
      return kAnswered;
    case USBDEVFS_GETDRIVER:
      return ENODATA;
    case USBDEVFS_CONTROL:
      return control(client);
    case USBDEVFS_SUBMITURB:
      return submit(client);
    case USBDEVFS_DISCARDURB:
      return discard(client);
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY: {
      const bool any = std::ranges::any_of(
          done_, [client](const Transfer& transfer) { return transfer.client == client; });
      if (any || !plugged_) {
        reap(client);
      } else {
        hold(client);
      }
      return kAnswersLater;
    }
    default:
      return ENOTTY;
  }
}

/// GET_CONFIGURATION is all that libusb asks on its own.
int UsbDevice::control(UMockdevIoctlClient* client) {
  const Data data =
      resolve(umockdev_ioctl_client_get_arg(client), 0, sizeof(usbdevfs_ctrltransfer));
  const auto& setup = *reinterpret_cast<const usbdevfs_ctrltransfer*>(data->data);
  constexpr std::uint8_t kGetConfiguration = 8;
  if (setup.bRequest != kGetConfiguration || setup.wLength != 1) return EPIPE;
  const Data answer = resolve(data.get(), offsetof(usbdevfs_ctrltransfer, data), 1);
  put<std::uint8_t>(answer.get(), 1);
  umockdev_ioctl_client_complete(client, 1, 0);
  return kAnswersLater;
}

int UsbDevice::submit(UMockdevIoctlClient* client) {
  ++submits_;
  if (refused_submits_ > 0) {
    --refused_submits_;
    return submit_error_;
  }
  Transfer transfer{
      client, resolve(umockdev_ioctl_client_get_arg(client), 0, sizeof(usbdevfs_urb)), {}, 0, {}};
  if (!transfer.urb) return EFAULT;
  const usbdevfs_urb& urb = transfer.fields();
  if (urb.type == USBDEVFS_URB_TYPE_CONTROL) return EPIPE;
  const auto size = static_cast<std::size_t>(urb.buffer_length);
  if (size > 0) transfer.buffer = resolve(transfer.urb.get(), offsetof(usbdevfs_urb, buffer), size);
  const std::uint8_t endpoint = urb.endpoint;
  pending_.push_back(std::move(transfer));
  const auto submitted = std::prev(pending_.end());
  if ((endpoint & kIn) == 0) {
    const auto* begin = reinterpret_cast<const std::byte*>(submitted->buffer->data);
    Bytes bytes(begin, begin + size);
    const int outcome = on_write_ ? on_write_(endpoint, bytes) : 0;
    if (outcome != kNeverDone)
      finish(submitted, outcome, outcome == 0 ? std::move(bytes) : Bytes{});
    return kAnswered;
  }
  const auto packet = std::ranges::find(packets_, endpoint, &Packet::endpoint);
  if (packet != packets_.end()) {
    finish(submitted, packet->error, std::move(packet->bytes));
    packets_.erase(packet);
  }
  changed_.notify_all();
  return kAnswered;
}

int UsbDevice::discard(UMockdevIoctlClient* client) {
  ++discards_;
  // The argument is the address of the urb itself.
  const gulong address =
      *reinterpret_cast<const gulong*>(umockdev_ioctl_client_get_arg(client)->data);
  const auto transfer = std::ranges::find_if(
      pending_, [&](const Transfer& each) { return each.urb->client_addr == address; });
  if (transfer == pending_.end()) return EINVAL;
  finish(transfer, ENOENT, {});
  return kAnswered;
}

void UsbDevice::hold(UMockdevIoctlClient* client) {
  auto* const held = new Held{this, UMOCKDEV_IOCTL_CLIENT(g_object_ref(client))};
  held_[client] = held;
  ++timers_;
  GSource* const timer = g_timeout_source_new(0);
  g_source_set_ready_time(timer, g_get_monotonic_time() + kHold_us);
  g_source_set_callback(timer, &UsbDevice::on_held_too_long, held, nullptr);
  g_source_attach(timer, g_main_context_get_thread_default());
  g_source_unref(timer);
}

gboolean UsbDevice::on_held_too_long(gpointer data) {
  const std::unique_ptr<Held> held(static_cast<Held*>(data));
  UsbDevice& device = *held->device;
  const std::lock_guard lock(device.mutex_);
  if (held->client != nullptr) device.wake(held->client);
  --device.timers_;
  device.changed_.notify_all();
  return G_SOURCE_REMOVE;
}

/// Answers the held question of `client`, if there is one. Its timer frees what is left of it.
void UsbDevice::wake(UMockdevIoctlClient* client) {
  const auto held = held_.find(client);
  if (held == held_.end()) return;
  held->second->client = nullptr;
  held_.erase(held);
  reap(client);
  g_object_unref(client);
}

/// Hands out the oldest finished transfer.
void UsbDevice::reap(UMockdevIoctlClient* client) {
  const auto oldest = std::ranges::find_if(
      done_, [client](const Transfer& transfer) { return transfer.client == client; });
  if (oldest == done_.end()) {
    umockdev_ioctl_client_complete(client, -1, plugged_ ? EAGAIN : ENODEV);
    return;
  }
  Transfer transfer = std::move(*oldest);
  done_.erase(oldest);
  usbdevfs_urb& urb = transfer.fields();
  const auto room = static_cast<std::size_t>(urb.buffer_length);
  if (transfer.bytes.size() > room) {
    transfer.bytes.resize(room);
    transfer.error = EOVERFLOW;
  }
  if ((urb.endpoint & kIn) != 0 && !transfer.bytes.empty())
    std::memcpy(transfer.buffer->data, transfer.bytes.data(), transfer.bytes.size());
  urb.actual_length = static_cast<int>(transfer.bytes.size());
  urb.status = -transfer.error;
  const Data pointer = resolve(umockdev_ioctl_client_get_arg(client), 0, sizeof(void*));
  umockdev_ioctl_data_set_ptr(pointer.get(), 0, transfer.urb.get());
  umockdev_ioctl_client_complete(client, 0, 0);
}

}  // namespace veneer::tracking::mock
