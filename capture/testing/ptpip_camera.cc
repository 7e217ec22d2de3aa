// SPDX-License-Identifier: Apache-2.0
#include "capture/testing/ptpip_camera.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>

#include "base/result.h"

namespace veneer::capture::testing {
namespace {

// Codes of PTP (ISO 15740) and packet types of PTP/IP.
constexpr std::uint16_t kOk = 0x2001, kGeneralError = 0x2002, kNotSupported = 0x2005;
constexpr std::uint16_t kInvalidHandle = 0x2009, kInvalidParameter = 0x201D, kDeviceBusy = 0x2019;
constexpr std::uint16_t kPropertyNotSupported = 0x200A, kInvalidValue = 0x201C;
constexpr std::uint16_t kExposureTime = 0x500D, kExposureIndex = 0x500F;
constexpr std::uint16_t kObjectAdded = 0x4002, kCaptureComplete = 0x400D;
constexpr std::uint32_t kStorage = 0x00010001;

enum PacketType : std::uint32_t {
  kInitCommand = 1,
  kInitCommandAck = 2,
  kInitEvent = 3,
  kInitEventAck = 4,
  kRequest = 6,
  kResponse = 7,
  kEvent = 8,
  kStartData = 9,
  kData = 10,
  kEndData = 12,
};

class Writer {
 public:
  template <class T>
  Writer& put(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bytes_.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i)));
    }
    return *this;
  }
  Writer& u8(std::uint8_t v) { return put(v); }
  Writer& u16(std::uint16_t v) { return put(v); }
  Writer& u32(std::uint32_t v) { return put(v); }
  Writer& u64(std::uint64_t v) { return put(v); }
  /// Length with the closing zero, then UTF-16; nothing but a 0 for an empty one.
  Writer& text(std::string_view ascii) {
    if (ascii.empty()) return u8(0);
    u8(static_cast<std::uint8_t>(ascii.size() + 1));
    return wide(ascii);
  }
  Writer& wide(std::string_view ascii) {
    for (const char c : ascii) u16(static_cast<std::uint8_t>(c));
    return u16(0);
  }
  Writer& codes(std::initializer_list<std::uint16_t> values) {
    u32(static_cast<std::uint32_t>(values.size()));
    for (const auto value : values) u16(value);
    return *this;
  }
  Writer& raw(std::string_view bytes) {
    bytes_.append(bytes);
    return *this;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::uint64_t number_at(std::string_view bytes, std::size_t offset, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size && offset + i < bytes.size(); ++i) {
    value |= std::uint64_t{static_cast<std::uint8_t>(bytes[offset + i])} << (8 * i);
  }
  return value;
}

bool read_whole(int fd, char* to, std::size_t size) {
  while (size > 0) {
    const auto got = ::recv(fd, to, size, 0);
    if (got <= 0) return false;
    to += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

struct Packet {
  std::uint32_t type = 0;
  std::string payload;
};

std::optional<Packet> read_packet(int fd) {
  std::array<char, 8> head{};
  if (!read_whole(fd, head.data(), head.size())) return std::nullopt;
  const std::string_view view(head.data(), head.size());
  const auto length = number_at(view, 0, 4);
  if (length < 8 || length > (1U << 24)) return std::nullopt;
  Packet packet{static_cast<std::uint32_t>(number_at(view, 4, 4)), std::string(length - 8, '\0')};
  if (!read_whole(fd, packet.payload.data(), packet.payload.size())) return std::nullopt;
  return packet;
}

bool send_packet(int fd, std::uint32_t type, std::string_view payload) {
  Writer packet;
  packet.u32(static_cast<std::uint32_t>(payload.size() + 8)).u32(type).raw(payload);
  std::string_view rest = packet.bytes();
  while (!rest.empty()) {
    const auto sent = ::send(fd, rest.data(), rest.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    rest.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

std::uint16_t format_of(std::string_view name) {
  return name.ends_with(".JPG") ? 0x3801 : 0x3000;  // EXIF/JPEG; undefined, as RAW files are
}

std::string device_info() {
  return Writer()
      .u16(100)
      .u32(0)
      .u16(100)
      .text("")
      .u16(0)
      .codes({0x1001,
              0x1002,
              0x1003,
              0x1004,
              0x1005,
              0x1006,
              0x1007,
              0x1008,
              0x1009,
              0x100B,
              0x100E,
              0x1014,
              0x1015,
              0x1016})
      .codes({kObjectAdded, kCaptureComplete})
      .codes({kExposureTime, kExposureIndex})
      .codes({0x3801, 0x3000})
      .codes({0x3801, 0x3000})
      .text("Veneer")
      .text("Loopback DSLR")
      .text("1.0")
      .text("0815")
      .bytes();
}

}  // namespace

struct PtpipCamera::Request {
  std::uint16_t code = 0;
  std::array<std::uint32_t, 5> parameters{};
  std::string data;
};

struct PtpipCamera::Answer {
  // NOLINTNEXTLINE(google-explicit-constructor): answer() returns codes and data alike
  Answer(std::uint16_t response = kOk) : code(response) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Answer(std::string bytes) : data(std::move(bytes)) {}
  std::uint16_t code = kOk;
  std::optional<std::string> data;
  bool hang = false;
  bool cut = false;  // the connection ends in the middle of the data
};

PtpipCamera::PtpipCamera(Shoot shoot)
    : shoot_(std::move(shoot)),
      listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)),
      stop_(::eventfd(0, EFD_CLOEXEC)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* general = reinterpret_cast<sockaddr*>(&address);
  VENEER_CHECK(listener_ && stop_ && ::bind(listener_.value(), general, size) == 0 &&
               ::listen(listener_.value(), 4) == 0 &&
               ::getsockname(listener_.value(), general, &size) == 0);
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { serve(); });
}

PtpipCamera::~PtpipCamera() {
  const std::uint64_t one = 1;
  VENEER_CHECK(::write(stop_.value(), &one, sizeof one) == sizeof one);
  thread_.join();
}

std::string PtpipCamera::port() const { return fmt::format("ptpip:127.0.0.1:{0}:{0}", port_); }

void PtpipCamera::misbehave(PtpFault fault, int captures) {
  const std::lock_guard lock(mutex_);
  faults_.insert(faults_.end(), static_cast<std::size_t>(captures), fault);
}

void PtpipCamera::offer_exposures(std::vector<std::uint32_t> exposures) {
  const std::lock_guard lock(mutex_);
  exposures_ = std::move(exposures);
  exposure_ = exposures_.front();
}

std::uint16_t PtpipCamera::iso() const {
  const std::lock_guard lock(mutex_);
  return iso_;
}

int PtpipCamera::files() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(objects_.size());
}

void PtpipCamera::serve() {
  // The command connection comes first, then that of the events.
  // Ends without one when the camera is to end, or when `other` (may be -1) has ended.
  const auto accept_one = [this](int other) -> UniqueFd {
    std::array<pollfd, 3> wait{
        {{listener_.value(), POLLIN, 0}, {stop_.value(), POLLIN, 0}, {other, POLLIN, 0}}};
    ::poll(wait.data(), wait.size(), -1);
    if (wait[1].revents != 0 || wait[2].revents != 0) return {};
    UniqueFd fd(::accept4(listener_.value(), nullptr, nullptr, SOCK_CLOEXEC));
    const int on = 1;
    if (fd) ::setsockopt(fd.value(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return fd;
  };
  while (true) {
    const UniqueFd command = accept_one(-1);
    if (!command) return;
    auto hello = read_packet(command.value());
    if (!hello || hello->type != kInitCommand) continue;
    send_packet(command.value(),
                kInitCommandAck,
                Writer().u32(1).raw("veneer-loopback.").wide("loopback").u32(0x10000).bytes());
    const UniqueFd event = accept_one(command.value());
    if (!event) continue;
    hello = read_packet(event.value());
    if (!hello || hello->type != kInitEvent) continue;
    send_packet(event.value(), kInitEventAck, "");
    serve_connection(command.value(), event.value());
  }
}

void PtpipCamera::serve_connection(int command, int event) {
  const auto stopped_or_readable = [&] {
    std::array<pollfd, 2> wait{{{command, POLLIN, 0}, {stop_.value(), POLLIN, 0}}};
    ::poll(wait.data(), wait.size(), -1);
    return wait[1].revents == 0;
  };
  while (stopped_or_readable()) {
    const auto packet = read_packet(command);
    if (!packet || packet->type != kRequest) return;
    const std::string_view body = packet->payload;
    const bool sends_data = number_at(body, 0, 4) == 2;
    const auto transaction = static_cast<std::uint32_t>(number_at(body, 6, 4));
    Request request{static_cast<std::uint16_t>(number_at(body, 4, 2)), {}, {}};
    for (std::size_t i = 0; i < request.parameters.size(); ++i) {
      request.parameters[i] = static_cast<std::uint32_t>(number_at(body, 10 + 4 * i, 4));
    }
    while (sends_data) {
      const auto part = read_packet(command);
      if (!part) return;
      if (part->type == kData || part->type == kEndData) request.data += part->payload.substr(4);
      if (part->type == kEndData) break;
    }
    const Answer reply = answer(request);
    if (reply.hang) {
      pollfd wait{stop_.value(), POLLIN, 0};
      ::poll(&wait, 1, -1);
      return;
    }
    if (reply.data) {
      send_packet(command, kStartData, Writer().u32(transaction).u64(reply.data->size()).bytes());
      if (reply.cut) {
        send_packet(
            command, kData, Writer().u32(transaction).raw(reply.data->substr(0, 100)).bytes());
        return;
      }
      send_packet(command, kEndData, Writer().u32(transaction).raw(*reply.data).bytes());
    }
    send_packet(command, kResponse, Writer().u16(reply.code).u32(transaction).bytes());
    send_events(event);
  }
}

void PtpipCamera::send_events(int event) {
  const std::lock_guard lock(mutex_);
  for (const auto& [code, parameter] : events_) {
    send_packet(event, kEvent, Writer().u16(code).u32(0).u32(parameter).bytes());
  }
  events_.clear();
}

PtpipCamera::Answer PtpipCamera::capture() {
  ++captures_;
  std::optional<PtpFault> fault;
  if (!faults_.empty()) {
    fault = faults_.front();
    faults_.pop_front();
  }
  if (fault == PtpFault::kBusy) return kDeviceBusy;
  if (fault == PtpFault::kRefused) return kGeneralError;
  if (fault == PtpFault::kHang) {
    Answer never;
    never.hang = true;
    return never;
  }
  close_in_data_ = fault == PtpFault::kCloseInData;
  if (fault != PtpFault::kNoPicture) {
    for (PtpObject& object : shoot_(exposure_, iso_)) {
      objects_[++last_handle_] = std::move(object);
      events_.emplace_back(kObjectAdded, last_handle_);
    }
  }
  events_.emplace_back(kCaptureComplete, 0);
  return {};
}

PtpipCamera::Answer PtpipCamera::answer(const Request& request) {
  const std::lock_guard lock(mutex_);
  const auto first = request.parameters[0];
  const auto object = objects_.find(first);
  switch (request.code) {
    case 0x1001:
      return device_info();
    case 0x1002:
    case 0x1003:
      return {};
    case 0x1004:
      return Writer().u32(1).u32(kStorage).bytes();
    case 0x1005: {
      Writer info;
      info.u16(4).u16(3).u16(0).u64(std::uint64_t{1} << 34).u64(std::uint64_t{1} << 33).u32(1000);
      return info.text("card").text("CARD").bytes();
    }
    case 0x1007: {  // GetObjectHandles: one flat folder
      Writer handles;
      handles.u32(static_cast<std::uint32_t>(objects_.size()));
      for (const auto& [handle, file] : objects_) handles.u32(handle);
      return handles.bytes();
    }
    case 0x1008: {
      if (object == objects_.end()) return kInvalidHandle;
      const auto& [name, bytes] = object->second;
      Writer info;
      info.u32(kStorage).u16(format_of(name)).u16(0).u32(static_cast<std::uint32_t>(bytes.size()));
      // Without a thumbnail, libgphoto2 takes an undefined format for no picture.
      info.u16(0x3808).u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).u16(0).u32(0).u32(0);
      return info.text(name).text("").text("").text("").bytes();
    }
    case 0x1009: {
      if (object == objects_.end()) return kInvalidHandle;
      Answer file(object->second.bytes);
      file.cut = close_in_data_;
      return file;
    }
    case 0x100B:
      return objects_.erase(first) == 1 ? kOk : kInvalidHandle;
    case 0x100E:
      return capture();
    case 0x1014:
      if (first == kExposureTime) {
        Writer description;
        description.u16(kExposureTime).u16(6).u8(1).u32(exposure_).u32(exposure_).u8(2);
        description.u16(static_cast<std::uint16_t>(exposures_.size()));
        for (const auto exposure : exposures_) description.u32(exposure);
        return description.bytes();
      }
      if (first == kExposureIndex) {
        Writer description;
        description.u16(kExposureIndex).u16(4).u8(1).u16(iso_).u16(iso_).u8(2).u16(3);
        return description.u16(100).u16(200).u16(400).bytes();
      }
      return kPropertyNotSupported;
    case 0x1015:
      if (first == kExposureTime) return Writer().u32(exposure_).bytes();
      if (first == kExposureIndex) return Writer().u16(iso_).bytes();
      return kPropertyNotSupported;
    case 0x1016: {
      const auto value = static_cast<std::uint32_t>(number_at(request.data, 0, 4));
      if (first == kExposureIndex) {
        iso_ = static_cast<std::uint16_t>(value);
        return {};
      }
      if (first != kExposureTime) return kPropertyNotSupported;
      if (std::find(exposures_.begin(), exposures_.end(), value) == exposures_.end()) {
        return kInvalidValue;
      }
      exposure_ = value;
      return {};
    }
    case 0x1006:
      return kInvalidParameter;
    default:
      return kNotSupported;
  }
}

}  // namespace veneer::capture::testing
