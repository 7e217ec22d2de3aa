// SPDX-License-Identifier: Apache-2.0
#include "calibration/internal_reading_session.h"

namespace veneer::calibration {

Result<Xyz> ReadingSession::read(Target target,
                                 const Eigen::Vector2d& pixel,
                                 int repeats,
                                 std::string_view what) {
  Xyz sum = Xyz::Zero();
  for (int i = 0; i < repeats; ++i) {
    auto reading = read_patiently(target, pixel);
    if (!reading) return fail_while(fmt::format("reading {}", what), reading.error());
    if (!reading->allFinite())
      return fail(Errc::kBadFormat,
                  "reading {}: {} gave a value that is not a number; check that it is not "
                  "overexposed and read again",
                  what,
                  colorimeter_.description());
    sum += *reading;
    ++readings_;
    progress_.advance();
  }
  return Xyz(sum / repeats);
}

Result<Xyz> ReadingSession::show_and_read(Target target,
                                          const Eigen::Vector2d& pixel,
                                          const Rgb16& code,
                                          int repeats,
                                          std::string_view what) {
  VENEER_TRY(show(code));
  return read(target, pixel, repeats, what);
}

Result<Xyz> ReadingSession::read_patiently(Target target, const Eigen::Vector2d& pixel) {
  constexpr int kAttempts = 3;
  for (int attempt = 1;; ++attempt) {
    auto reading = colorimeter_.read(target, pixel);
    if (reading || reading.error().code != Errc::kTimeout || attempt == kAttempts) return reading;
  }
}

}  // namespace veneer::calibration
