// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "capture/cameras/v4l2/internal_controls.h"

namespace veneer::capture {
namespace {

constexpr double kUnit_s = 100e-6;

struct Automatic {
  std::uint32_t control;
  std::int32_t off;
  const char* name;
};

// Exposure first: with it some cameras let go of the gain as well.
constexpr std::array<Automatic, 4> kAutomatics{{
    {V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL, "exposure"},
    {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0, "frame rate"},
    {V4L2_CID_AUTOGAIN, 0, "gain"},
    {V4L2_CID_AUTO_WHITE_BALANCE, 0, "white balance"},
}};

bool is_there(ControlPort& port, std::uint32_t control, v4l2_queryctrl& description, int& error) {
  description = {};
  error = port.query(control, description);
  if (error == EINVAL || error == ENOTTY) {
    error = 0;
    return false;
  }
  return error == 0 && (description.flags & V4L2_CTRL_FLAG_DISABLED) == 0;
}

}  // namespace

tl::unexpected<Error> control_failed(const std::string& doing, int error) {
  if (error == ENODEV || error == ENXIO) {
    return fail(
        Errc::kDisconnected, "{}: the camera was unplugged; plug it in and open it again", doing);
  }
  return fail(Errc::kIo, "{}: {}", doing, std::strerror(error));
}

Status switch_automatics_off(ControlPort& port) {
  for (const auto& [control, off, name] : kAutomatics) {
    const std::string doing = fmt::format("switching automatic {} off", name);
    v4l2_queryctrl description{};
    int error = 0;
    if (!is_there(port, control, description, error)) {
      if (error != 0) return control_failed(doing, error);
      continue;
    }
    std::int32_t value = 0;
    error = port.read(control, value);
    if (error != 0) return control_failed(doing, error);
    if (value == off) continue;
    error = port.write(control, off);
    if (error == ENODEV) return control_failed(doing, error);
    const int after = port.read(control, value);
    if (after != 0) return control_failed(doing, after);
    if (value != off) {
      return fail(Errc::kUnavailable,
                  "{}: the camera keeps it on ({}), so that its pictures cannot be compared; does "
                  "another program set it (`v4l2-ctl --list-ctrls`)? Else take another camera",
                  doing,
                  error == 0 ? "and says nothing" : std::strerror(error));
    }
  }
  return {};
}

Result<std::optional<ExposureControl>> ExposureControl::find(ControlPort& port) {
  v4l2_queryctrl description{};
  int error = 0;
  if (!is_there(port, V4L2_CID_EXPOSURE_ABSOLUTE, description, error)) {
    if (error != 0) return control_failed("looking for the camera's exposure", error);
    return std::nullopt;
  }
  ExposureControl control;
  control.least_ = std::max(1, description.minimum);
  control.most_ = std::max(control.least_, description.maximum);
  control.step_ = std::max(1, description.step);
  return control;
}

ExposureRange ExposureControl::range() const { return {least_ * kUnit_s, most_ * kUnit_s}; }

Result<std::int32_t> ExposureControl::units(double seconds) const {
  const double wanted = seconds / kUnit_s;
  // Half a unit beyond an end is that end, rounded. NaN is out of the range.
  if (!(wanted >= least_ - 0.5 && wanted <= most_ + 0.5)) {
    return fail(Errc::kInvalidOption,
                "an exposure of {} s is out of the camera's range of {:.6g} to {:.6g} s",
                seconds,
                range().least_s,
                range().most_s);
  }
  const double steps = std::round((wanted - least_) / step_);
  const double last = (most_ - least_) / step_;
  return least_ + step_ * static_cast<std::int32_t>(std::clamp(steps, 0.0, last));
}

Result<double> ExposureControl::set(ControlPort& port, double seconds) const {
  VENEER_ASSIGN(const std::int32_t wanted, units(seconds));
  const std::string doing = fmt::format("setting the exposure to {} s", wanted * kUnit_s);
  const int error = port.write(V4L2_CID_EXPOSURE_ABSOLUTE, wanted);
  if (error == EACCES || error == EINVAL || error == EBUSY) {
    return fail(Errc::kUnavailable,
                "{}: the camera does not take it ({}); is its automatic exposure on again?",
                doing,
                std::strerror(error));
  }
  if (error != 0) return control_failed(doing, error);
  return read(port);
}

Result<double> ExposureControl::read(ControlPort& port) const {
  std::int32_t value = 0;
  const int error = port.read(V4L2_CID_EXPOSURE_ABSOLUTE, value);
  if (error != 0) return control_failed("reading the exposure", error);
  return value * kUnit_s;
}

}  // namespace veneer::capture
