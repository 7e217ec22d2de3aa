// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace veneer::tracking {

/// The models whose binary frames begin with a two-letter tag.
enum class PolhemusModel { kLiberty, kPatriot };

/// The letters that begin a frame of this model.
[[nodiscard]] constexpr std::array<char, 2> tag_of(PolhemusModel model) {
  return model == PolhemusModel::kLiberty ? std::array{'L', 'Y'} : std::array{'P', 'A'};
}

/// One binary frame for the output list "8,9,11,3,7" (time stamp, frame count, distortion,
/// position, quaternion), little-endian:
///
///     0 tag (2)   2 station, from 1   3 command that asked for it   4 error, ' ' for none   5
///     reserved 6 u16 bytes that follow: 40     8 u32 ms   12 u32 frame count   16 i32 distortion
///     20 f32 x, y, z in centimetres   32 f32 w, x, y, z
///
/// Source: the layouts read by VRPN's and by ROS's Polhemus drivers.
struct PolhemusFrame {
  std::uint8_t station = 1;  ///< 1 to 16
  std::uint8_t command = 'C';
  std::uint8_t error = ' ';
  std::uint32_t milliseconds = 0;
  std::uint32_t count = 0;
  std::int32_t distortion = 0;
  Eigen::Vector3f position_cm = Eigen::Vector3f::Zero();
  Eigen::Quaternionf rotation = Eigen::Quaternionf::Identity();

  static constexpr std::size_t kHeader = 8;
  static constexpr std::size_t kPayload = 40;
  static constexpr std::size_t kBytes = kHeader + kPayload;
  static constexpr std::uint8_t kNoError = ' ';
  static constexpr int kStations = 16;
  /// Of a LIBERTY. Its frame count is the finer clock, the milliseconds are made of it.
  static constexpr double kFrames_hz = 240;
};

/// The frame as the device sends it.
[[nodiscard]] std::array<std::byte, PolhemusFrame::kBytes> encode(const PolhemusFrame& frame,
                                                                  PolhemusModel model);
/// Whether `bytes` begin as a frame does, as far as they go: tag, station, command and size. At
/// most the first kHeader bytes are looked at.
[[nodiscard]] bool may_be_frame(std::span<const std::byte> bytes, PolhemusModel model);
/// @param bytes  kBytes of them, for which may_be_frame() holds.
[[nodiscard]] PolhemusFrame decode(std::span<const std::byte> bytes);

}  // namespace veneer::tracking
