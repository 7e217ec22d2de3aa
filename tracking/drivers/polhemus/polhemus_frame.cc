// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/polhemus/polhemus_frame.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/result.h"

namespace veneer::tracking {
namespace {

static_assert(std::endian::native == std::endian::little, "frames are copied as they are");

template <class T>
void put(std::span<std::byte> bytes, std::size_t at, const T& value) {
  std::memcpy(bytes.subspan(at, sizeof(T)).data(), &value, sizeof(T));
}

template <class T>
T get(std::span<const std::byte> bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.subspan(at, sizeof(T)).data(), sizeof(T));
  return value;
}

/// Continuous output, or a single record.
bool is_command_of_records(std::uint8_t command) { return command == 'C' || command == 'P'; }

}  // namespace

std::array<std::byte, PolhemusFrame::kBytes> encode(const PolhemusFrame& frame,
                                                    PolhemusModel model) {
  std::array<std::byte, PolhemusFrame::kBytes> bytes{};
  put(bytes, 0, tag_of(model));
  put(bytes, 2, frame.station);
  put(bytes, 3, frame.command);
  put(bytes, 4, frame.error);
  put(bytes, 6, static_cast<std::uint16_t>(PolhemusFrame::kPayload));
  put(bytes, 8, frame.milliseconds);
  put(bytes, 12, frame.count);
  put(bytes, 16, frame.distortion);
  const Eigen::Vector3f& p = frame.position_cm;
  const Eigen::Quaternionf& q = frame.rotation;
  put(bytes, 20, std::array{p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
  return bytes;
}

bool may_be_frame(std::span<const std::byte> bytes, PolhemusModel model) {
  const std::array<char, 2> tag = tag_of(model);
  constexpr std::size_t kSize = PolhemusFrame::kPayload;
  for (std::size_t i = 0; i < std::min(bytes.size(), PolhemusFrame::kHeader); ++i) {
    const auto byte = std::to_integer<std::uint8_t>(bytes[i]);
    const bool fits = i < 2    ? byte == static_cast<std::uint8_t>(tag[i])
                      : i == 2 ? byte >= 1 && byte <= PolhemusFrame::kStations
                      : i == 3 ? is_command_of_records(byte)
                      : i == 6 ? byte == (kSize & 0xFFU)
                      : i == 7 ? byte == (kSize >> 8U)
                               : true;
    if (!fits) return false;
  }
  return true;
}

PolhemusFrame decode(std::span<const std::byte> bytes) {
  VENEER_CHECK(bytes.size() == PolhemusFrame::kBytes);
  PolhemusFrame frame;
  frame.station = get<std::uint8_t>(bytes, 2);
  frame.command = get<std::uint8_t>(bytes, 3);
  frame.error = get<std::uint8_t>(bytes, 4);
  frame.milliseconds = get<std::uint32_t>(bytes, 8);
  frame.count = get<std::uint32_t>(bytes, 12);
  frame.distortion = get<std::int32_t>(bytes, 16);
  const auto n = get<std::array<float, 7>>(bytes, 20);
  frame.position_cm = {n[0], n[1], n[2]};
  frame.rotation = Eigen::Quaternionf(n[3], n[4], n[5], n[6]);
  return frame;
}

}  // namespace veneer::tracking
