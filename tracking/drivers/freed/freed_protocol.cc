// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/freed/freed_protocol.h"

#include <numbers>

namespace veneer::tracking {
namespace {

constexpr std::byte kPose{0xD1};
constexpr std::size_t kPoseSize = 29;
// Offsets into the message, three bytes each.
constexpr std::size_t kPan = 2;
constexpr std::size_t kTilt = 5;
constexpr std::size_t kRoll = 8;
constexpr std::size_t kX = 11;
constexpr std::size_t kY = 14;
constexpr std::size_t kHeight = 17;
constexpr double kRadiansPerUnit = std::numbers::pi / 180 / 32768;
constexpr double kMetresPerUnit = 0.001 / 64;

/// All bytes of a message with its checksum add up to this.
constexpr unsigned kSum = 0x40;

bool checksum_holds(std::span<const std::byte> message) {
  unsigned sum = 0;
  for (const std::byte each : message) sum += std::to_integer<unsigned>(each);
  return (sum & 0xFFU) == kSum;
}

/// A signed number of 24 bits.
double number_at(std::span<const std::byte> message, std::size_t offset) {
  const auto byte = [&](std::size_t i) {
    return std::to_integer<std::int32_t>(message[offset + i]);
  };
  const std::int32_t value = byte(0) << 16 | byte(1) << 8 | byte(2);
  return value >= 1 << 23 ? value - (1 << 24) : value;
}

/// FreeD's axes from the body's, for a camera at zero: the columns are its right, down and forward.
Eigen::Matrix3d camera_at_zero() {
  Eigen::Matrix3d freed_from_body;
  freed_from_body << 1, 0, 0,  //
      0, 0, 1,                 //
      0, -1, 0;
  return freed_from_body;
}

/// A world with +y up from FreeD's axes.
Eigen::Matrix3d y_up() {
  Eigen::Matrix3d world_from_freed;
  world_from_freed << 1, 0, 0,  //
      0, 0, 1,                  //
      0, -1, 0;
  return world_from_freed;
}

RawSample pose_of(std::span<const std::byte> message, FreedProtocol::Up up) {
  const auto angle = [&](std::size_t offset, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(number_at(message, offset) * kRadiansPerUnit, axis);
  };
  const Eigen::Matrix3d world_from_freed =
      up == FreedProtocol::Up::kY ? y_up() : Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d freed_from_body =
      (angle(kPan, -Eigen::Vector3d::UnitZ()) * angle(kTilt, Eigen::Vector3d::UnitX()) *
       angle(kRoll, Eigen::Vector3d::UnitY()))
          .toRotationMatrix() *
      camera_at_zero();
  RawSample sample;
  sample.sensor = std::to_integer<int>(message[1]);
  sample.position_m =
      world_from_freed * kMetresPerUnit *
      Eigen::Vector3d(number_at(message, kX), number_at(message, kY), number_at(message, kHeight));
  sample.rotation = Eigen::Quaterniond(world_from_freed * freed_from_body).normalized();
  return sample;
}

}  // namespace

void FreedProtocol::feed(std::span<const std::byte> bytes,
                         std::vector<RawSample>& samples,
                         std::vector<std::byte>&) {
  while (!bytes.empty()) {
    const bool whole = bytes.front() == kPose && bytes.size() >= kPoseSize;
    if (whole && checksum_holds(bytes.first(kPoseSize))) {
      samples.push_back(pose_of(bytes.first(kPoseSize), up_));
      bytes = bytes.subspan(kPoseSize);
      continue;
    }
    if (whole) ++counters_.bad_frames;
    ++counters_.skipped_bytes;
    bytes = bytes.subspan(1);
  }
}

}  // namespace veneer::tracking
