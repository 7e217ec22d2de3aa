// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/clock.h"
#include "base/image.h"
#include "calibration/patch_display.h"
#include "calibration/wizard/operator.h"
#include "projector/output.h"

namespace veneer::calibration {

/// Patches through the output that frames go through. The lamp cannot be switched off from here, so
/// the operator is asked to cover the lens.
class OutputPatchDisplay final : public PatchDisplay {
 public:
  struct Options {
    int width = 0;  ///< of the raster, pixels
    int height = 0;
    int bits = 8;
    /// Waited after each picture: window system, projector and eye of the instrument must have it.
    double settle_s = 0.4;
  };
  /// All borrowed; must outlive the display.
  OutputPatchDisplay(projector::Output& output, Operator& hands, Clock& clock, Options options)
      : output_(output),
        hands_(hands),
        clock_(clock),
        options_(options),
        picture_(options.width, options.height) {}

  /// Errors: also kCancelled (the lens was not covered when asked to), those of the output.
  [[nodiscard]] Status show(const Rgb16& code, bool lit = true) override;
  [[nodiscard]] Status show_picture(ImageView<const Rgb16> codes) override;

 private:
  [[nodiscard]] Status present();
  [[nodiscard]] Status cover(bool covered);

  projector::Output& output_;
  Operator& hands_;
  Clock& clock_;
  Options options_;
  Image<Rgb16> picture_;
  std::uint64_t frames_ = 0;
  std::optional<bool> covered_;  // not known when a session is resumed
};

}  // namespace veneer::calibration
