// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "base/progress.h"
#include "calibration/instruments/colorimeter.h"
#include "calibration/patch_display.h"

namespace veneer::calibration {

/// A colorimeter and a display, with retries, averaging and checks of what is read.
class ReadingSession {
 public:
  /// All borrowed; must outlive the session. Progress advances by one with each reading.
  ReadingSession(Colorimeter& colorimeter, PatchDisplay& display, Progress& progress)
      : colorimeter_(colorimeter), display_(display), progress_(progress) {}

  [[nodiscard]] Status show(const Rgb16& code, bool lit = true) { return display_.show(code, lit); }
  /// The mean of `repeats` readings. A time-out is tried again, twice.
  /// @param what  for error messages.   Errors: kBadFormat (a reading that is not a number), those
  /// of the instrument.
  [[nodiscard]] Result<Xyz> read(Target target,
                                 const Eigen::Vector2d& pixel,
                                 int repeats,
                                 std::string_view what);
  [[nodiscard]] Result<Xyz> show_and_read(Target target,
                                          const Eigen::Vector2d& pixel,
                                          const Rgb16& code,
                                          int repeats,
                                          std::string_view what);
  [[nodiscard]] int readings() const { return readings_; }

 private:
  [[nodiscard]] Result<Xyz> read_patiently(Target target, const Eigen::Vector2d& pixel);

  Colorimeter& colorimeter_;
  PatchDisplay& display_;
  Progress& progress_;
  int readings_ = 0;
};

}  // namespace veneer::calibration
