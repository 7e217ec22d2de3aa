// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/output_display.h"

#include <algorithm>

namespace veneer::calibration {

Status OutputPatchDisplay::show(const Rgb16& code, bool lit) {
  const unsigned full = (1U << static_cast<unsigned>(options_.bits)) - 1;
  if (*std::ranges::max_element(code) > full)
    return fail(Errc::kInvalidOption,
                "showing a patch: code {}, {}, {} is over {}",
                code[0],
                code[1],
                code[2],
                full);
  VENEER_TRY(cover(!lit));
  std::ranges::fill(picture_.pixels(), code);
  return present();
}

Status OutputPatchDisplay::show_picture(ImageView<const Rgb16> codes) {
  if (codes.width() != picture_.width() || codes.height() != picture_.height())
    return fail(Errc::kInvalidOption,
                "showing a picture: it has {} x {} pixels, the projector {} x {}",
                codes.width(),
                codes.height(),
                picture_.width(),
                picture_.height());
  VENEER_TRY(cover(false));
  for (int y = 0; y < codes.height(); ++y)
    std::ranges::copy(codes.row(y), picture_.view().row(y).begin());
  return present();
}

Status OutputPatchDisplay::cover(bool covered) {
  if (covered == covered_) return {};
  VENEER_ASSIGN(
      const Answer answer,
      hands_.please(covered ? Request{Task::kCoverLens,
                                      0,
                                      "Cover the projector's lens, so that only the room's "
                                      "light is left."}
                            : Request{Task::kUncoverLens, 0, "See that the lens is uncovered."}));
  if (answer != Answer::kDone)
    return fail(Errc::kCancelled,
                "{} the lens was refused; what follows would be wrong",
                covered ? "covering" : "uncovering");
  covered_ = covered;
  return {};
}

Status OutputPatchDisplay::present() {
  projector::Frame frame;
  frame.number = frames_++;
  frame.codes = picture_.view();
  frame.bits = options_.bits;
  frame.display_time = clock_.now();
  VENEER_TRY(output_.present(frame));
  clock_.sleep_until(clock_.now() + from_seconds(options_.settle_s));
  return {};
}

}  // namespace veneer::calibration
