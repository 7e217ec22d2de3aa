// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/image.h"
#include "base/result.h"

namespace veneer::calibration {

/// What shows patches and patterns while an instrument or a camera looks at them. One thread.
class PatchDisplay {
 public:
  virtual ~PatchDisplay() = default;
  /// The whole raster in one code triple; `lit` false is the lamp off (only ambient is left).
  /// Errors: kInvalidOption (a code that the display does not have).
  [[nodiscard]] virtual Status show(const Rgb16& code, bool lit = true) = 0;
  /// A picture in codes. Errors: kInvalidOption (not of the raster's size, or as above).
  [[nodiscard]] virtual Status show_picture(ImageView<const Rgb16> codes) = 0;
};

}  // namespace veneer::calibration
