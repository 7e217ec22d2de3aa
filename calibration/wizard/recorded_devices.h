// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "base/journal.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/patch_display.h"

namespace veneer::calibration {

/// A display and a colorimeter whose readings are kept in a journal. A reading that the journal has
/// is not taken again, and the patch for it is not even shown: so whatever measures through these
/// two can be killed at any reading and run again, and knows nothing of it. What measures must ask
/// for the same readings in the same order within a step.
class RecordedDevices final : public PatchDisplay, public Colorimeter {
 public:
  /// All borrowed; must outlive this.
  RecordedDevices(PatchDisplay& display, Colorimeter& colorimeter, Journal& journal)
      : display_(display), colorimeter_(colorimeter), journal_(journal) {}

  /// Readings belong to this step from now on.
  void begin(std::string step) {
    step_ = std::move(step);
    times_.clear();
  }
  [[nodiscard]] Status show(const Rgb16& code, bool lit = true) override;
  /// At once: a picture is for a camera.
  [[nodiscard]] Status show_picture(ImageView<const Rgb16> codes) override;
  [[nodiscard]] std::string description() const override { return colorimeter_.description(); }
  [[nodiscard]] Result<Xyz> read(Target target, const Eigen::Vector2d& pixel) override;
  /// Readings that were really taken, and those that the journal had.
  [[nodiscard]] int taken() const { return taken_; }
  [[nodiscard]] int recalled() const { return recalled_; }

 private:
  PatchDisplay& display_;
  Colorimeter& colorimeter_;
  Journal& journal_;
  std::string step_;
  std::map<std::string, int> times_;  // that the same was read in this step
  Rgb16 code_{};
  bool lit_ = true;
  bool shown_ = false;  // whether the display has been told
  int taken_ = 0;
  int recalled_ = 0;
};

}  // namespace veneer::calibration
