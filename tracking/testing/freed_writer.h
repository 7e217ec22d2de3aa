// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <vector>

namespace veneer::tracking::freed {

using Bytes = std::vector<std::byte>;

/// A D1 message, written from the table of the manual and apart from what reads it. For tests and
/// as the seeds of the fuzzer.
struct Message {
  int camera = 1;
  double pan_deg = 0;
  double tilt_deg = 0;
  double roll_deg = 0;
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();  // x, y, height
  int zoom = 0;
  int focus = 0;
  int user = 0;

  [[nodiscard]] Bytes bytes() const {
    Bytes out{std::byte{0xD1}, static_cast<std::byte>(camera)};
    const auto put = [&out](long value, int count) {
      for (int shift = 8 * (count - 1); shift >= 0; shift -= 8)
        out.push_back(static_cast<std::byte>(value >> shift & 0xFF));
    };
    for (const double angle : {pan_deg, tilt_deg, roll_deg}) put(std::lround(angle * 32768), 3);
    for (const double length : position_mm) put(std::lround(length * 64), 3);
    put(zoom, 3);
    put(focus, 3);
    put(user, 2);
    int sum = 0;
    for (const std::byte each : out) sum += std::to_integer<int>(each);
    put(0x40 - sum, 1);
    return out;
  }
};

}  // namespace veneer::tracking::freed
