// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <optional>

#include "calibration/patch_display.h"

namespace veneer::calibration {

/// What a display shows just now.
struct ShownPatch {
  Eigen::Vector3d drive = Eigen::Vector3d::Zero();  ///< in [0, 1]^3
  bool lit = true;                                  ///< false: the lamp is off
};

/// Passes everything on to another display and remembers it, for instruments that know only by this
/// what they look at. One thread.
class WatchedDisplay final : public PatchDisplay {
 public:
  /// @param display  borrowed; must outlive this.   @param bits  of its codes, 1 to 16 (checked).
  WatchedDisplay(PatchDisplay& display, int bits);
  [[nodiscard]] Status show(const Rgb16& code, bool lit = true) override;
  [[nodiscard]] Status show_picture(ImageView<const Rgb16> codes) override;
  /// Empty before the first patch, after a picture, and where the display refused.
  [[nodiscard]] const std::optional<ShownPatch>& shown() const { return shown_; }

 private:
  PatchDisplay& display_;
  double full_scale_;
  std::optional<ShownPatch> shown_;
};

}  // namespace veneer::calibration
