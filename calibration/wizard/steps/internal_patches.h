// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "calibration/wizard/step.h"

namespace veneer::calibration {

/// The middle of the raster, where readings are taken unless another spot is meant.
[[nodiscard]] inline Eigen::Vector2d raster_centre(const Devices& devices) {
  return {0.5 * devices.width, 0.5 * devices.height};
}

[[nodiscard]] inline std::uint16_t full_code(const Devices& devices) {
  return static_cast<std::uint16_t>((1U << static_cast<unsigned>(devices.bits)) - 1);
}

[[nodiscard]] inline Rgb16 grey(std::uint16_t code) { return {code, code, code}; }

/// `count` readings of one patch on the white board, at the raster's centre. Errors: those of the
/// devices; kBadFormat (a reading that is not a number).
[[nodiscard]] inline Result<std::vector<Xyz>> read_patch(StepContext& context,
                                                         const Rgb16& code,
                                                         int count,
                                                         bool lit = true) {
  VENEER_TRY(context.recorded.show(code, lit));
  std::vector<Xyz> readings;
  for (int i = 0; i < count; ++i) {
    VENEER_ASSIGN(const Xyz xyz,
                  context.recorded.read(Target::kWhiteReference, raster_centre(context.devices)));
    if (!xyz.allFinite())
      return fail(Errc::kBadFormat,
                  "{} gave a value that is not a number; is it overexposed?",
                  context.recorded.description());
    readings.push_back(xyz);
  }
  return readings;
}

}  // namespace veneer::calibration
