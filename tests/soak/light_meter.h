// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "base/image.h"
#include "calibration/profile.h"

namespace veneer::soak {

/// What codes send, by arithmetic of its own: tone curves and primaries as the profile has them,
/// nothing of what renders or compensates. Knows no residual.
class LightMeter {
 public:
  explicit LightMeter(const calibration::ProjectorProfile& profile) : black_(profile.black.y()) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (const double t : profile.tone_curves[c])
        nits_[c].push_back(t * profile.primaries(1, static_cast<int>(c)));
    }
  }

  /// cd/m^2 of the brightest pixel, on a perfect diffuser where G is 1.
  /// Codes beyond the tone curves count as infinitely bright.
  [[nodiscard]] double brightest(ImageView<const Rgb16> codes) const {
    double most = 0;
    for (int y = 0; y < codes.height(); ++y) {
      for (int x = 0; x < codes.width(); ++x) {
        double sum = black_;
        for (std::size_t c = 0; c < 3; ++c) {
          const std::size_t code = codes(x, y)[c];
          sum += code < nits_[c].size() ? nits_[c][code] : HUGE_VAL;
        }
        most = std::max(most, sum);
      }
    }
    return most;
  }

  /// Pixels that send more than black does.
  [[nodiscard]] static int lit(ImageView<const Rgb16> codes) {
    int count = 0;
    for (int y = 0; y < codes.height(); ++y) {
      for (int x = 0; x < codes.width(); ++x) {
        const Rgb16& code = codes(x, y);
        count += code[0] != 0 || code[1] != 0 || code[2] != 0 ? 1 : 0;
      }
    }
    return count;
  }

 private:
  std::array<std::vector<double>, 3> nits_;
  double black_;
};

}  // namespace veneer::soak
