// SPDX-License-Identifier: Apache-2.0
#include "calibration/wizard/aimed_colorimeter.h"

namespace veneer::calibration {

Result<Xyz> AimedColorimeter::read(Target target, const Eigen::Vector2d& pixel) {
  const std::pair aim(target, pixel);
  if (aim_ != aim) {
    const bool object = target == Target::kObject;
    VENEER_ASSIGN(
        const Answer answer,
        hands_.please(
            {object ? Task::kAimAtObject : Task::kAimAtBoard,
             0,
             fmt::format("Point the instrument at {}, where the picture's pixel {:.0f}, "
                         "{:.0f} falls.",
                         object ? "a piece of the object's surface that stands in the white "
                                  "board's place"
                                : "the white board",
                         pixel.x(),
                         pixel.y())}));
    if (answer != Answer::kDone)
      return fail(Errc::kCancelled, "reading a patch: the instrument was not pointed at it");
    aim_ = aim;
  }
  return instrument_.read(target, pixel);
}

}  // namespace veneer::calibration
