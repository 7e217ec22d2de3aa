// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

// What a VRPN server says, written from Format_Of_Protocol.txt and apart from what reads it. For
// tests and as the seeds of the fuzzer.
namespace veneer::tracking::vrpn {

using Bytes = std::vector<std::byte>;

constexpr std::int32_t kSenderDescription = -1;
constexpr std::int32_t kTypeDescription = -2;

template <class T>
void put(Bytes& out, T value) {
  static_assert(sizeof(T) == 4 || sizeof(T) == 8);
  const auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
  // Last byte first, since the machines we build for are little-endian; one by one, since g++ 12
  // warns of an overflow that is none when it inlines insert().
  for (std::size_t i = raw.size(); i > 0; --i) out.push_back(raw[i - 1]);
}

inline Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

inline Bytes cookie(std::string_view version = "07.35") {
  Bytes out;
  for (const char each : std::string_view("vrpn: ver. "))
    out.push_back(static_cast<std::byte>(each));
  for (const char each : version) out.push_back(static_cast<std::byte>(each));
  for (const char each : std::string_view("  0")) out.push_back(static_cast<std::byte>(each));
  out.resize(24);
  return out;
}

/// The moment in a header.
struct Stamp {
  std::int32_t seconds = 0;
  std::int32_t microseconds = 0;
};

/// @param length  what the header says; by default the truth.
inline Bytes message(std::int32_t sender,
                     std::int32_t type,
                     const Bytes& payload,
                     Stamp stamp = {},
                     std::int64_t length = -1) {
  Bytes out;
  put(out,
      static_cast<std::uint32_t>(length < 0 ? 24 + static_cast<std::int64_t>(payload.size())
                                            : length));
  put(out, stamp.seconds);
  put(out, stamp.microseconds);
  put(out, sender);
  put(out, type);
  put(out, std::int32_t{12345});  // which nobody may rely on
  out = out + payload;
  while (out.size() % 8 != 0) out.push_back(std::byte{0xEE});
  return out;
}

inline Bytes description(std::int32_t kind, std::int32_t number, std::string_view name) {
  Bytes payload;
  put(payload, static_cast<std::int32_t>(name.size() + 1));
  for (const char each : name) payload.push_back(static_cast<std::byte>(each));
  payload.push_back(std::byte{0});
  return message(number, kind, payload);
}

struct Pose {
  std::int32_t sensor = 0;
  std::array<double, 3> position{};
  std::array<double, 4> rotation_xyzw{0, 0, 0, 1};
};
inline Bytes pose_message(std::int32_t sender, std::int32_t type, const Pose& pose, Stamp stamp) {
  Bytes payload;
  put(payload, pose.sensor);
  put(payload, std::int32_t{0});
  for (const double each : pose.position) put(payload, each);
  for (const double each : pose.rotation_xyzw) put(payload, each);
  return message(sender, type, payload, stamp);
}

// Numbers that the server of our tests has given.
constexpr std::int32_t kTracker = 3;
constexpr std::int32_t kPose = 7;
constexpr std::int32_t kPing = 8;

/// The greeting of a server with a tracker and another device.
inline Bytes greeting(std::string_view tracker) {
  return cookie() + description(kSenderDescription, 2, "Button0") +
         description(kSenderDescription, kTracker, tracker) +
         description(kTypeDescription, 6, "vrpn_Tracker Velocity") +
         description(kTypeDescription, kPose, "vrpn_Tracker Pos_Quat") +
         description(kTypeDescription, kPing, "vrpn_Base ping_message");
}

}  // namespace veneer::tracking::vrpn
