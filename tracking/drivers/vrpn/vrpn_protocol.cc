// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/vrpn/vrpn_protocol.h"

#include <algorithm>
#include <bit>
#include <string_view>

namespace veneer::tracking {
namespace {

constexpr std::size_t kCookieSize = 24;
/// Servers accept each other up to the last point: another minor version is none of our business.
constexpr std::string_view kCookie = "vrpn: ver. 07.38  0";
constexpr std::string_view kMajorVersion = kCookie.substr(0, kCookie.rfind('.') + 1);

constexpr std::size_t kHeaderSize = 24;  // five numbers, and one to align what follows
constexpr std::size_t kAlignment = 8;
/// VRPN's own buffers hold no more.
constexpr std::uint32_t kLongestMessage = 64000;
constexpr std::size_t kPoseSize = 64;
constexpr std::int32_t kMostSensors = 1024;  // of each something is remembered

constexpr std::int32_t kSenderDescription = -1;
constexpr std::int32_t kTypeDescription = -2;
constexpr std::string_view kPoseName = "vrpn_Tracker Pos_Quat";
constexpr std::string_view kPingName = "vrpn_Base ping_message";
constexpr std::string_view kPongName = "vrpn_Base pong_message";

// Our own numbers, which start() announces.
constexpr std::int32_t kOurTracker = 0;
constexpr std::int32_t kOurPing = 0;
constexpr std::int32_t kOurPong = 1;

std::uint64_t big_endian(std::span<const std::byte> bytes) {
  std::uint64_t value = 0;
  for (const std::byte each : bytes) value = value << 8U | std::to_integer<std::uint64_t>(each);
  return value;
}
std::uint32_t unsigned_at(std::span<const std::byte> bytes, std::size_t offset) {
  return static_cast<std::uint32_t>(big_endian(bytes.subspan(offset, 4)));
}
std::int32_t signed_at(std::span<const std::byte> bytes, std::size_t offset) {
  return static_cast<std::int32_t>(unsigned_at(bytes, offset));
}
double real_at(std::span<const std::byte> bytes, std::size_t offset) {
  return std::bit_cast<double>(big_endian(bytes.subspan(offset, 8)));
}

constexpr std::size_t padded(std::size_t size) {
  return (size + kAlignment - 1) / kAlignment * kAlignment;
}

void put(std::vector<std::byte>& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::byte>(value >> shift & 0xFFU));
}
void put(std::vector<std::byte>& out, std::int32_t value) {
  put(out, static_cast<std::uint32_t>(value));
}
void put(std::vector<std::byte>& out, std::string_view text) {
  for (const char each : text) out.push_back(static_cast<std::byte>(each));
}

void put_header(std::vector<std::byte>& out,
                std::size_t payload,
                std::uint32_t seconds,
                std::uint32_t microseconds,
                std::int32_t sender,
                std::int32_t type) {
  put(out, static_cast<std::uint32_t>(kHeaderSize + payload));
  put(out, seconds);
  put(out, microseconds);
  put(out, sender);
  put(out, type);
  put(out, 0);
}

void put_description(std::vector<std::byte>& out,
                     std::int32_t kind,
                     std::int32_t number,
                     std::string_view name) {
  const std::size_t size = name.size() + 1;  // with the zero at its end
  put_header(out, 4 + size, 0, 0, number, kind);
  put(out, static_cast<std::uint32_t>(size));
  put(out, name);
  out.resize(out.size() + padded(4 + size) - 4 - name.size());
}

}  // namespace

std::vector<Command> VrpnProtocol::start() const {
  Command greeting;
  put(greeting.bytes, kCookie);
  greeting.bytes.resize(kCookieSize);
  put_description(greeting.bytes, kSenderDescription, kOurTracker, tracker_);
  put_description(greeting.bytes, kTypeDescription, kOurPing, kPingName);
  put_description(greeting.bytes, kTypeDescription, kOurPong, kPongName);
  return {greeting};
}

std::vector<Command> VrpnProtocol::restart() const {
  Command ping;
  put_header(ping.bytes, 0, 0, 0, kOurTracker, kOurPing);
  return {ping};
}

void VrpnProtocol::reset() {
  agreed_ = {};
  pending_.clear();
}

void VrpnProtocol::feed(std::span<const std::byte> bytes,
                        std::vector<RawSample>& samples,
                        std::vector<std::byte>& reply) {
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  Bytes rest = pending_;
  while (const std::size_t taken = agreed_.broken ? 0 : take(rest, samples, reply))
    rest = rest.subspan(taken);
  if (agreed_.broken) {
    counters_.skipped_bytes += rest.size();
    rest = {};
  }
  pending_.erase(pending_.begin(), pending_.end() - static_cast<std::ptrdiff_t>(rest.size()));
}

std::size_t VrpnProtocol::take(Bytes bytes,
                               std::vector<RawSample>& samples,
                               std::vector<std::byte>& reply) {
  if (!agreed_.greeted) {
    if (bytes.size() < kCookieSize) return 0;
    std::string cookie;
    for (const std::byte each : bytes.first(kMajorVersion.size()))
      cookie += static_cast<char>(each);
    if (cookie != kMajorVersion) return break_off();
    agreed_.greeted = true;
    return kCookieSize;
  }
  if (bytes.size() < kHeaderSize) return 0;
  const Header header = header_of(bytes);
  if (header.length < kHeaderSize || header.length > kLongestMessage) return break_off();
  const std::size_t size = padded(header.length);
  if (bytes.size() < size) return 0;
  take_message(header, bytes.subspan(kHeaderSize, header.length - kHeaderSize), samples, reply);
  return agreed_.broken ? 0 : size;
}

std::size_t VrpnProtocol::break_off() {
  ++counters_.bad_frames;
  agreed_.broken = true;
  return 0;
}

VrpnProtocol::Header VrpnProtocol::header_of(Bytes message) {
  return {unsigned_at(message, 0),
          unsigned_at(message, 4),
          unsigned_at(message, 8),
          signed_at(message, 12),
          signed_at(message, 16)};
}

void VrpnProtocol::take_message(const Header& header,
                                Bytes payload,
                                std::vector<RawSample>& samples,
                                std::vector<std::byte>& reply) {
  if (header.type == kSenderDescription || header.type == kTypeDescription) {
    take_description(header, payload);
  } else if (header.type < 0 || header.sender != agreed_.tracker) {
    return;  // of the system (a log, a UDP port we do not want), or of another device
  } else if (header.type == agreed_.pose) {
    take_pose(header, payload, samples);
  } else if (header.type == agreed_.ping) {
    put_header(reply, 0, header.seconds, header.microseconds, kOurTracker, kOurPong);
  }
}

void VrpnProtocol::take_description(const Header& header, Bytes payload) {
  const std::uint32_t size = payload.size() < 4 ? 0 : unsigned_at(payload, 0);
  if (header.sender < 0 || size == 0 || size > payload.size() - 4 ||
      payload[4 + size - 1] != std::byte{0}) {
    break_off();
    return;
  }
  std::string name;
  for (const std::byte each : payload.subspan(4, size - 1)) name += static_cast<char>(each);
  const auto agree = [&](std::string_view known, std::optional<std::int32_t>& number) {
    if (name == known) {
      number = header.sender;
    } else if (number == header.sender) {
      number.reset();  // it was given to another
    }
  };
  if (header.type == kSenderDescription) {
    agree(tracker_, agreed_.tracker);
  } else {
    agree(kPoseName, agreed_.pose);
    agree(kPingName, agreed_.ping);
  }
}

void VrpnProtocol::take_pose(const Header& header, Bytes payload, std::vector<RawSample>& samples) {
  if (payload.size() != kPoseSize || signed_at(payload, 0) < 0 ||
      signed_at(payload, 0) >= kMostSensors) {
    ++counters_.bad_frames;  // the next message is where it should be all the same
    return;
  }
  const auto number = [&](std::size_t i) { return real_at(payload, 8 + 8 * i); };
  RawSample sample;
  sample.sensor = signed_at(payload, 0);
  sample.ticks = std::uint64_t{header.seconds} * 1'000'000 + header.microseconds;
  sample.position_m = {number(0), number(1), number(2)};
  sample.rotation = Eigen::Quaterniond(number(6), number(3), number(4), number(5));  // w is last
  samples.push_back(sample);
}

}  // namespace veneer::tracking
