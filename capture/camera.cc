// SPDX-License-Identifier: Apache-2.0
#include "capture/camera.h"

namespace veneer::capture {

Status Camera::set_gain_db(double /*gain*/) {
  return fail(Errc::kUnavailable, "{}: its gain cannot be set; leave it out", description());
}

Status Camera::set_pixel_format(std::string_view name) {
  return fail(Errc::kUnavailable,
              "{}: it has one pixel format, so \"{}\" cannot be chosen; leave it out",
              description(),
              name);
}

Status Camera::set_trigger(Trigger trigger) {
  if (trigger == Trigger::kFree) return {};
  return fail(Errc::kUnavailable,
              "{}: it has no trigger; set trigger to \"free\" or leave it out",
              description());
}

}  // namespace veneer::capture
