// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/recorded_devices.h"

#include <array>
#include <cmath>

namespace veneer::calibration {

Status RecordedDevices::show(const Rgb16& code, bool lit) {
  code_ = code;
  lit_ = lit;
  shown_ = false;
  return {};
}

Status RecordedDevices::show_picture(ImageView<const Rgb16> codes) {
  shown_ = false;
  return display_.show_picture(codes);
}

Result<Xyz> RecordedDevices::read(Target target, const Eigen::Vector2d& pixel) {
  const std::string what = fmt::format("{}{},{},{} {} {:.3f},{:.3f}",
                                       lit_ ? "" : "off ",
                                       code_[0],
                                       code_[1],
                                       code_[2],
                                       target == Target::kObject ? "object" : "white",
                                       pixel.x(),
                                       pixel.y());
  const std::string key = fmt::format("{} #{}", what, times_[what]);
  if (const nlohmann::json* known = journal_.find(step_, key);
      known != nullptr && known->is_array() && known->size() == 3) {
    Xyz xyz;
    for (std::size_t i = 0; i < 3; ++i)
      xyz[static_cast<Eigen::Index>(i)] = (*known)[i].is_number() ? (*known)[i].get<double>() : NAN;
    ++times_[what];
    ++recalled_;
    return xyz;
  }
  if (!shown_) {
    VENEER_TRY(display_.show(code_, lit_));
    shown_ = true;
  }
  VENEER_ASSIGN(const Xyz xyz, colorimeter_.read(target, pixel));
  // One that is no number is for whoever measures to refuse; it is not kept, so that it is read
  // again when the session is resumed.
  if (xyz.allFinite())
    VENEER_TRY(journal_.add(step_, key, std::array<double, 3>{xyz.x(), xyz.y(), xyz.z()}));
  ++times_[what];
  ++taken_;
  return xyz;
}

}  // namespace veneer::calibration
