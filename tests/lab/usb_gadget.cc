// SPDX-License-Identifier: Apache-2.0
#include "tests/lab/usb_gadget.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <string_view>
#include <system_error>

namespace veneer::lab {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;

const fs::path kConfigFs = "/sys/kernel/config";
constexpr milliseconds kPollPeriod{5};
constexpr seconds kPatience{15};

/// An attribute of configfs is written in one call.
Status write_attribute(const fs::path& path, std::string_view text) {
  const UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
  if (!fd || ::write(fd.value(), text.data(), text.size()) != static_cast<ssize_t>(text.size()))
    return fail(
        Errc::kIo,
        "playing a USB device: {} does not take what is written to it ({}); this needs root and "
        "the gadget modules of the kernel lab",
        path.string(),
        std::strerror(errno));
  return {};
}

Status make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error)
    return fail(
        Errc::kIo,
        "playing a USB device: {} cannot be made ({}); this needs root and the gadget modules of "
        "the kernel lab",
        path.string(),
        error.message());
  return {};
}

std::string first_line(const fs::path& path) {
  std::string line;
  std::ifstream file(path);
  std::getline(file, line);
  return line;
}

/// Until it holds, or patience ends.
bool wait_until(const std::function<bool()>& holds) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(kPollPeriod);
  }
  return true;
}

}  // namespace

UsbGadget::~UsbGadget() {
  if (folder_.empty()) return;
  static_cast<void>(unplug());
  // Configfs goes as it came, and only so.
  std::error_code ignored;
  for (const std::string& each : functions_) fs::remove(folder_ / "configs/c.1" / each, ignored);
  ::rmdir((folder_ / "configs/c.1").c_str());
  for (const std::string& each : functions_) ::rmdir((folder_ / "functions" / each).c_str());
  ::rmdir((folder_ / "strings/0x409").c_str());
  ::rmdir(folder_.c_str());
}

Status UsbGadget::create(const GadgetIdentity& identity) {
  if (!fs::exists(kConfigFs / "usb_gadget")) {
    static_cast<void>(::mount("none", kConfigFs.c_str(), "configfs", 0, nullptr));
  }
  static std::atomic<int> number{0};
  folder_ = kConfigFs / "usb_gadget" / fmt::format("veneer{}_{}", ::getpid(), ++number);
  VENEER_TRY(make_folder(folder_ / "strings/0x409"));
  VENEER_TRY(make_folder(folder_ / "configs/c.1"));
  VENEER_TRY(write_attribute(folder_ / "idVendor", fmt::format("0x{:04x}", identity.vendor)));
  VENEER_TRY(write_attribute(folder_ / "idProduct", fmt::format("0x{:04x}", identity.product)));
  VENEER_TRY(write_attribute(folder_ / "strings/0x409/product", identity.name));
  if (identity.serial.empty()) return {};
  return write_attribute(folder_ / "strings/0x409/serialnumber", identity.serial);
}

Result<fs::path> UsbGadget::add_function(const std::string& function) {
  const fs::path path = folder_ / "functions" / function;
  VENEER_TRY(make_folder(path));
  functions_.push_back(function);
  return path;
}

Status UsbGadget::finish_function(const std::string& function) {
  std::error_code error;
  fs::create_symlink(folder_ / "functions" / function, folder_ / "configs/c.1" / function, error);
  if (error) return fail(Errc::kIo, "playing a USB device: {}: {}", function, error.message());
  return {};
}

Status UsbGadget::plug() {
  if (plugged_) return {};
  std::vector<std::string> taken;
  for (const auto& each : fs::directory_iterator(kConfigFs / "usb_gadget"))
    taken.push_back(first_line(each.path() / "UDC"));
  for (const auto& each : fs::directory_iterator("/sys/class/udc")) {
    const std::string port = each.path().filename();
    if (std::ranges::count(taken, port) > 0) continue;
    VENEER_TRY(write_attribute(folder_ / "UDC", port));
    plugged_ = true;
    return {};
  }
  return fail(Errc::kIo,
              "playing a USB device: no port is free; load dummy_hcd with a greater `num`");
}

Status UsbGadget::unplug() {
  if (!plugged_) return {};
  plugged_ = false;
  return write_attribute(folder_ / "UDC", "\n");
}

// --- HID

namespace {

/// One report of 64 bytes each way, of a page of the vendor's.
constexpr std::string_view kHidDescriptor(
    "\x06\x00\xff\x09\x01\xa1\x01\x15\x00\x26\xff\x00\x75\x08\x95\x40\x09\x01\x81\x02\x95\x40\x09"
    "\x01"
    "\x91\x02\xc0",
    27);

}  // namespace

HidGadget::~HidGadget() { static_cast<void>(unplug()); }

std::size_t HidGadget::count_nodes() const {
  const std::string id =
      fmt::format("HID_ID=0003:{:08X}:{:08X}", identity_.vendor, identity_.product);
  std::size_t count = 0;
  std::error_code error;
  for (const auto& each : fs::directory_iterator("/sys/class/hidraw", error)) {
    std::ifstream file(each.path() / "device/uevent");
    for (std::string line; std::getline(file, line);)
      if (line == id) ++count;
  }
  return count;
}

Status HidGadget::create() {
  VENEER_TRY(usb_.create(identity_));
  if (layout_.another_first) {
    VENEER_ASSIGN(const fs::path other, usb_.add_function("SourceSink.0"));
    VENEER_TRY(usb_.finish_function(other.filename()));
  }
  for (int i = 0; i < layout_.hid_interfaces; ++i) {
    const std::string name = fmt::format("hid.{}_{}_{}", identity_.name, ::getpid(), i);
    VENEER_ASSIGN(const fs::path folder, usb_.add_function(name));
    VENEER_TRY(write_attribute(folder / "report_length", fmt::format("{}", HidReport().size())));
    VENEER_TRY(write_attribute(folder / "report_desc", kHidDescriptor));
    VENEER_TRY(usb_.finish_function(name));
    folders_.push_back(folder);
  }
  return {};
}

Status HidGadget::plug() {
  if (thread_.joinable()) return {};
  if (folders_.empty()) VENEER_TRY(create());
  const std::size_t before = count_nodes();
  VENEER_TRY(usb_.plug());
  // The device's own ends have numbers of the kernel's choice; nodes of ours need not wait for
  // udev.
  for (const fs::path& folder : folders_) {
    unsigned major = 0;
    unsigned minor = 0;
    char colon = 0;
    std::ifstream(folder / "dev") >> major >> colon >> minor;
    const std::string node = fmt::format("/run/lab-{}", folder.filename().string());
    ::unlink(node.c_str());
    if (::mknod(node.c_str(), S_IFCHR | 0600, ::makedev(major, minor)) != 0)
      return fail(Errc::kIo, "playing a USB device: {}: {}", node, std::strerror(errno));
    UniqueFd end(::open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
    ::unlink(node.c_str());
    if (!end) return fail(Errc::kIo, "playing a USB device: {}: {}", node, std::strerror(errno));
    ends_.push_back(std::move(end));
  }
  stop_ = false;
  thread_ = std::thread([this] { run(); });
  if (!wait_until([&] { return count_nodes() == before + folders_.size(); }))
    return fail(Errc::kIo, "playing a USB device: the host does not see {}", identity_.name);
  return {};
}

Status HidGadget::unplug() {
  const Status pulled = usb_.unplug();
  stop_ = true;
  if (thread_.joinable()) thread_.join();
  ends_.clear();
  return pulled;
}

void HidGadget::run() {
  std::vector<pollfd> polled;
  for (const UniqueFd& end : ends_) polled.push_back({end.value(), POLLIN, 0});
  while (!stop_) {
    // Bounded, as an end that goes away wakes nobody.
    if (::poll(polled.data(), polled.size(), 20) <= 0) continue;
    for (std::size_t i = 0; i < polled.size(); ++i) {
      HidReport report{};
      if ((polled[i].revents & POLLIN) == 0) continue;
      if (::read(polled[i].fd, report.data(), report.size()) <= 0) {
        std::this_thread::sleep_for(kPollPeriod);
        continue;
      }
      for (const HidReport& reply : answer_(static_cast<int>(i), report))
        while (!stop_ && ::write(polled[i].fd, reply.data(), reply.size()) < 0 && errno == EAGAIN)
          std::this_thread::sleep_for(milliseconds(1));
    }
  }
}

// --- bulk

namespace {

void put(std::string& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<char>(value >> (8 * i)));
}

/// How many endpoints to the host stand before the one that is used, see BulkGadget::kIn.
constexpr int kUnused = 3;

/// One interface of no class with bulk endpoints: one from the host, the rest to it. Source:
/// USB 2.0, 9.6, and the kernel's include/uapi/linux/usb/functionfs.h for what is around it.
std::string function_descriptors() {
  constexpr std::uint32_t kMagic = 3;
  constexpr std::uint32_t kFullSpeed = 1;
  constexpr std::uint32_t kHighSpeed = 2;
  constexpr int kEndpoints = 2 + kUnused;
  std::string body;
  put(body, 1 + kEndpoints, 4);
  put(body, 1 + kEndpoints, 4);
  for (const std::uint64_t packet : {64, 512}) {
    for (const std::uint64_t each : {9, 4, 0, 0, kEndpoints, 0xff, 0, 0, 0}) put(body, each, 1);
    for (int i = 0; i < kEndpoints; ++i) {
      put(body, 7, 1);
      put(body, 5, 1);
      put(body, i == 0 ? 0x01 : 0x80U + static_cast<std::uint64_t>(i), 1);
      put(body, 2, 1);
      put(body, packet, 2);
      put(body, 0, 1);
    }
  }
  std::string all;
  put(all, kMagic, 4);
  put(all, 12 + body.size(), 4);
  put(all, kFullSpeed | kHighSpeed, 4);
  return all + body;
}

/// No strings.
std::string function_strings() {
  std::string all;
  for (const std::uint32_t each : {2U, 16U, 0U, 0U}) put(all, each, 4);
  return all;
}

}  // namespace

BulkGadget::~BulkGadget() {
  static_cast<void>(unplug());
  stop_ = true;
  if (thread_.joinable()) thread_.join();
  in_.reset();
  out_.reset();
  control_.reset();
  if (!mount_.empty()) ::umount(mount_.c_str());
}

Status BulkGadget::create() {
  const std::string name = fmt::format("{}{}", identity_.name, ::getpid());
  VENEER_TRY(usb_.create(identity_));
  VENEER_ASSIGN(const fs::path folder, usb_.add_function("ffs." + name));
  const fs::path mount = fs::path("/run") / ("lab-" + name);
  VENEER_TRY(make_folder(mount));
  if (::mount(name.c_str(), mount.c_str(), "functionfs", 0, nullptr) != 0)
    return fail(Errc::kIo, "playing a USB device: no functionfs: {}", std::strerror(errno));
  mount_ = mount;
  control_ = UniqueFd(::open((mount / "ep0").c_str(), O_RDWR | O_CLOEXEC));
  for (const std::string& each : {function_descriptors(), function_strings()})
    if (!control_ || ::write(control_.value(), each.data(), each.size()) < 0)
      return fail(Errc::kIo, "playing a USB device: ep0: {}", std::strerror(errno));
  // Not blocking, else a device that is not plugged in holds its threads for ever.
  out_ = UniqueFd(::open((mount / "ep1").c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  in_ = UniqueFd(
      ::open((mount / fmt::format("ep{}", 2 + kUnused)).c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (!out_ || !in_)
    return fail(Errc::kIo, "playing a USB device: its endpoints: {}", std::strerror(errno));
  VENEER_TRY(usb_.finish_function("ffs." + name));
  thread_ = std::thread([this] { receive(); });
  return {};
}

Status BulkGadget::plug() {
  if (mount_.empty()) VENEER_TRY(create());
  return usb_.plug();
}

Status BulkGadget::unplug() { return usb_.unplug(); }

bool BulkGadget::send(std::span<const std::byte> bytes) {
  return ::write(in_.value(), bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
}

void BulkGadget::receive() {
  std::array<std::byte, 512> buffer{};
  while (!stop_) {
    const ssize_t size = ::read(out_.value(), buffer.data(), buffer.size());
    if (size > 0)
      received_(std::span(buffer).first(static_cast<std::size_t>(size)));
    else
      std::this_thread::sleep_for(kPollPeriod);
  }
}

}  // namespace veneer::lab
