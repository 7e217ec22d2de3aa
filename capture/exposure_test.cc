// SPDX-License-Identifier: Apache-2.0
#include "capture/exposure.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace veneer::capture {
namespace {

/// A grey ramp of which the brightest pixel would be `gain * exposure` counts.
CameraFrame ramp(double gain, double exposure_s) {
  CameraFrame frame;
  frame.counts = Image<Rgb16>(100, 100);
  frame.exposure_s = exposure_s;
  frame.full_scale = 4095;
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      const double counts = gain * exposure_s * (100 * y + x) / 9999.0;
      const auto value = static_cast<std::uint16_t>(std::min(counts, 4095.0));
      frame.counts(x, y) = {value, value, value};
    }
  }
  return frame;
}

TEST(Exposure, ReachesSeventyPercentFromAnyStart) {
  constexpr double kGain = 1e5;  // counts a second
  for (const double start_s : {1e-6, 1e-3, 0.04, 1.0, 10.0}) {
    double exposure_s = start_s;
    for (int i = 0; i < 8; ++i) exposure_s = better_exposure(ramp(kGain, exposure_s));
    EXPECT_NEAR(check_exposure(ramp(kGain, exposure_s)).p99, 0.7, 0.01) << start_s;
  }
}

TEST(Exposure, CountsWhatIsSaturated) {
  // Twice the range: the upper half of the ramp is cut.
  EXPECT_NEAR(check_exposure(ramp(2 * 4095, 1)).saturated_fraction, 0.5, 0.001);
  EXPECT_EQ(check_exposure(ramp(4000, 1)).saturated_fraction, 0.0);
  EXPECT_EQ(check_exposure(CameraFrame{}).p99, 0.0);
}

}  // namespace
}  // namespace veneer::capture
