// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/shown_patch.h"

namespace veneer::calibration {

WatchedDisplay::WatchedDisplay(PatchDisplay& display, int bits)
    : display_(display), full_scale_((1 << bits) - 1) {
  VENEER_CHECK(bits >= 1 && bits <= 16);
}

Status WatchedDisplay::show(const Rgb16& code, bool lit) {
  shown_.reset();
  VENEER_TRY(display_.show(code, lit));
  shown_ = ShownPatch{Eigen::Vector3d(code[0], code[1], code[2]) / full_scale_, lit};
  return {};
}

Status WatchedDisplay::show_picture(ImageView<const Rgb16> codes) {
  shown_.reset();
  return display_.show_picture(codes);
}

}  // namespace veneer::calibration
