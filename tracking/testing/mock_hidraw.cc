// SPDX-License-Identifier: Apache-2.0
#include "tracking/testing/mock_hidraw.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/hidraw.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>

#include "base/result.h"
#include "base/unique_handle.h"

// A node of this kind is a pseudo-terminal, so that poll() on it is real; but a terminal has no
// bounds between reports. So for every report one byte, a token, is written to the terminal, and
// the read that it wakes is answered from the queue.
namespace veneer::tracking::mock {
namespace {

struct Unref {
  template <class T>
  void operator()(T* object) const {
    g_object_unref(object);
  }
};
using Data = std::unique_ptr<UMockdevIoctlData, Unref>;

/// One input report and one feature report of bytes that the maker alone understands.
constexpr std::array<std::uint8_t, 27> kReportDescriptor{
    0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08,
    0x95, 0x34, 0x09, 0x01, 0x81, 0x02, 0x95, 0x5A, 0x09, 0x01, 0xB1, 0x02, 0xC0};

}  // namespace

HidrawDevice::HidrawDevice(HidDescription description, OnFeature on_feature)
    : description_(std::move(description)),
      on_feature_(std::move(on_feature)),
      handler_(umockdev_ioctl_base_new()) {
  g_signal_connect(handler_, "handle-read", G_CALLBACK(&HidrawDevice::on_read), this);
  g_signal_connect(handler_, "handle-write", G_CALLBACK(&HidrawDevice::on_write), this);
  g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(&HidrawDevice::on_ioctl), this);
  g_signal_connect(handler_, "client-connected", G_CALLBACK(&HidrawDevice::on_connected), this);
}

HidrawDevice::~HidrawDevice() {
  if (is_plugged()) unplug();
  g_object_unref(handler_);
}

std::string HidrawDevice::usb_path() const {
  const std::string& port = description_.usb_port;
  return fmt::format("/devices/pci0000:00/0000:00:14.0/usb{}/{}", std::stoi(port), port);
}

std::string HidrawDevice::description_text() const {
  const HidDescription& d = description_;
  const std::string hidraw = node_.substr(std::strlen("/dev/"));
  const std::string number = hidraw.substr(std::strlen("hidraw"));
  std::string text = fmt::format(
      "P: {path}/hidraw/{hidraw}\nN: {hidraw}\nE: DEVNAME={node}\nE: SUBSYSTEM=hidraw\n"
      "E: MAJOR=240\nE: MINOR={number}\nA: dev=240:{number}\\n\nL: device=../../../{leaf}\n\n",
      fmt::arg("path", hid_path_),
      fmt::arg("hidraw", hidraw),
      fmt::arg("node", node_),
      fmt::arg("number", number),
      fmt::arg("leaf", hid_path_.substr(hid_path_.rfind('/') + 1)));
  text += fmt::format(
      "P: {}\nE: SUBSYSTEM=hid\nE: DRIVER=hid-generic\nE: HID_ID=0003:0000{:04X}:0000{:04X}\n"
      "E: HID_NAME={}\nE: HID_UNIQ={}\n\n",
      hid_path_,
      d.vendor,
      d.product,
      d.name,
      d.serial);
  text += fmt::format(
      "P: {}\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_interface\nA: bInterfaceNumber={:02x}\\n\n\n",
      hid_path_.substr(0, hid_path_.rfind('/')),
      d.interface);
  // Another interface of the same device may be plugged in already.
  if (std::filesystem::exists(Bus::instance().root() + "/sys" + usb_path())) return text;
  text += fmt::format(
      "P: {}\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nA: idVendor={:04x}\\n\n"
      "A: idProduct={:04x}\\n\nA: bcdDevice=0100\\n\nA: product={}\\n\n",
      usb_path(),
      d.vendor,
      d.product,
      d.name);
  if (!d.serial.empty()) text += fmt::format("A: serial={}\\n\n", d.serial);
  return text;
}

void HidrawDevice::plug() {
  // umockdev cannot add a name of this kind twice.
  static std::atomic<int> next_number{0};
  VENEER_CHECK(!is_plugged());
  const int number = next_number++;
  node_ = fmt::format("/dev/hidraw{}", number);
  hid_path_ = fmt::format("{}/{}:1.{}/0003:{:04X}:{:04X}.{:04X}",
                          usb_path(),
                          description_.usb_port,
                          description_.interface,
                          description_.vendor,
                          description_.product,
                          number);
  Bus& bus = Bus::instance();
  bus.attach(node_, handler_);  // before there is a node to open: see UsbDevice::plug()
  bus.add(description_text());
  {
    const std::lock_guard lock(mutex_);
    plugged_ = true;
    reports_.clear();
    terminal_ = umockdev_testbed_get_dev_fd(bus.testbed(), node_.c_str());
  }
  bus.announce("/sys" + hid_path_ + "/hidraw" + node_.substr(std::strlen("/dev")), "add");
}

void HidrawDevice::unplug() {
  {
    const std::lock_guard lock(mutex_);
    VENEER_CHECK(plugged_);
    plugged_ = false;
    reports_.clear();
    hang_up();
  }
  Bus& bus = Bus::instance();
  const std::string hidraw = "/sys" + hid_path_ + "/hidraw" + node_.substr(std::strlen("/dev"));
  bus.announce(hidraw, "remove");
  bus.detach(node_);
  // umockdev would leave the parents, and then refuse to add them again.
  bus.remove(hidraw);
  bus.remove("/sys" + hid_path_);
  bus.remove("/sys" + hid_path_.substr(0, hid_path_.rfind('/')));
  const std::filesystem::path usb_folder = bus.root() + "/sys" + usb_path();
  const std::filesystem::directory_iterator entries(usb_folder);
  const bool has_interface = std::any_of(begin(entries), end(entries), [](const auto& entry) {
    return entry.path().filename().string().find(':') != std::string::npos;
  });
  if (!has_interface) bus.remove("/sys" + usb_path());
}

/// umockdev keeps its end of the terminal open, and a note of its name over which it would stumble
/// when the system gives the same terminal out again.
void HidrawDevice::hang_up() {
  std::array<char, 64> name{};
  if (::ptsname_r(terminal_, name.data(), name.size()) == 0) {
    std::string note = name.data();
    std::ranges::replace(note, '/', '_');
    std::filesystem::remove(Bus::instance().root() + "/dev/.ptymap/" + note);
  }
  const UniqueFd nothing(::open("/dev/null", O_RDWR | O_CLOEXEC));
  VENEER_CHECK(::dup2(nothing.value(), terminal_) == terminal_);
  terminal_ = -1;
}

bool HidrawDevice::is_plugged() const {
  const std::lock_guard lock(mutex_);
  return plugged_;
}

void HidrawDevice::send(Bytes report) { push({std::move(report), 0}); }

void HidrawDevice::fail_read(int error) { push({{}, error}); }

void HidrawDevice::push(Report report) {
  const std::lock_guard lock(mutex_);
  if (!plugged_) return;
  reports_.push_back(std::move(report));
  put_tokens(1);
}

void HidrawDevice::put_tokens(std::size_t count) {
  const Bytes tokens(count);
  if (terminal_ >= 0 && count > 0)
    VENEER_CHECK(::write(terminal_, tokens.data(), count) == static_cast<ssize_t>(count));
}

void HidrawDevice::on_connected(UMockdevIoctlBase*, UMockdevIoctlClient*, gpointer self) {
  ++static_cast<HidrawDevice*>(self)->openings_;
}

gboolean HidrawDevice::on_read(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto& device = *static_cast<HidrawDevice*>(self);
  ++device.reads_;
  // The read itself, of the terminal: it takes all the tokens that are there.
  int error = 0;
  const int tokens = umockdev_ioctl_client_execute(client, &error, nullptr);
  const std::lock_guard lock(device.mutex_);
  if (tokens <= 0 || device.reports_.empty()) {
    umockdev_ioctl_client_complete(client, -1, tokens < 0 ? error : EIO);
    return TRUE;
  }
  const Report report = std::move(device.reports_.front());
  device.reports_.pop_front();
  device.put_tokens(static_cast<std::size_t>(tokens) - 1);
  if (report.error != 0) {
    umockdev_ioctl_client_complete(client, -1, report.error);
    return TRUE;
  }
  UMockdevIoctlData* const buffer = umockdev_ioctl_client_get_arg(client);
  const auto room = static_cast<std::size_t>(buffer->data_len);
  const std::size_t size = std::min(report.bytes.size(), room);  // the kernel cuts off, too
  if (size > 0) std::memcpy(buffer->data, report.bytes.data(), size);
  umockdev_ioctl_client_complete(client, static_cast<glong>(size), 0);
  return TRUE;
}

gboolean HidrawDevice::on_write(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto& device = *static_cast<HidrawDevice*>(self);
  const bool plugged = device.is_plugged();
  const UMockdevIoctlData* const written = umockdev_ioctl_client_get_arg(client);
  const auto size = static_cast<std::size_t>(written->data_len);
  if (plugged && device.on_output_) {
    const auto* begin = reinterpret_cast<const std::byte*>(written->data);
    device.on_output_(Bytes(begin, begin + size));
  }
  umockdev_ioctl_client_complete(
      client, plugged ? static_cast<glong>(size) : -1, plugged ? 0 : ENODEV);
  return TRUE;
}

gboolean HidrawDevice::on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto& device = *static_cast<HidrawDevice*>(self);
  const unsigned long request = umockdev_ioctl_client_get_request(client);
  const std::size_t size = _IOC_SIZE(request);
  constexpr unsigned kSendFeature = 6;  // HIDIOCSFEATURE(length)
  const Data data(
      umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, size, nullptr));
  glong result = -1;
  int error = ENOTTY;
  if (!device.is_plugged()) {
    error = ENODEV;
  } else if (request == HIDIOCGRDESCSIZE) {
    const int bytes = kReportDescriptor.size();
    std::memcpy(data->data, &bytes, sizeof(bytes));
    result = 0;
  } else if (request == HIDIOCGRDESC) {
    auto& descriptor = *reinterpret_cast<hidraw_report_descriptor*>(data->data);
    descriptor.size = kReportDescriptor.size();
    std::ranges::copy(kReportDescriptor, descriptor.value);
    result = 0;
  } else if (_IOC_TYPE(request) == 'H' && _IOC_NR(request) == kSendFeature) {
    ++device.features_;
    const auto* begin = reinterpret_cast<const std::byte*>(data->data);
    error = device.on_feature_ ? device.on_feature_(Bytes(begin, begin + size)) : 0;
    if (error == 0) result = static_cast<glong>(size);
  }
  umockdev_ioctl_client_complete(client, result, result < 0 ? error : 0);
  return TRUE;
}

}  // namespace veneer::tracking::mock
