// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <optional>
#include <string>

#include "base/result.h"
#include "capture/camera.h"

namespace veneer::capture {

/// The controls of a V4L2 camera, as the kernel shows them. Errors are errno; 0 is success.
class ControlPort {
 public:
  virtual ~ControlPort() = default;
  /// EINVAL where there is no such control.
  virtual int query(std::uint32_t control, v4l2_queryctrl& description) = 0;
  virtual int read(std::uint32_t control, std::int32_t& value) = 0;
  virtual int write(std::uint32_t control, std::int32_t value) = 0;
};

/// Switches automatic exposure, gain, white balance and their kin off, where there are any, and
/// makes sure that they are. Errors: kUnavailable (one stays on: which), kDisconnected, kIo.
[[nodiscard]] Status switch_automatics_off(ControlPort& port);

/// The exposure time, in V4L2's unit of 100 us.
class ExposureControl {
 public:
  /// Nothing where the camera has none. Errors: kDisconnected, kIo.
  [[nodiscard]] static Result<std::optional<ExposureControl>> find(ControlPort& port);
  [[nodiscard]] ExposureRange range() const;
  /// The nearest step of the control. Errors: kInvalidOption (out of the range, which is named).
  [[nodiscard]] Result<std::int32_t> units(double seconds) const;
  /// Sets it and returns what the camera made of it, in seconds. Errors: also kUnavailable (it does
  /// not take it), kDisconnected, kIo.
  [[nodiscard]] Result<double> set(ControlPort& port, double seconds) const;
  /// What it is now, in seconds.
  [[nodiscard]] Result<double> read(ControlPort& port) const;

 private:
  std::int32_t least_ = 1, most_ = 1, step_ = 1;
};

/// An error from errno of a call on a camera that is open.
[[nodiscard]] tl::unexpected<Error> control_failed(const std::string& doing, int error);

}  // namespace veneer::capture
