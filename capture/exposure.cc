// SPDX-License-Identifier: Apache-2.0
#include "capture/exposure.h"

#include <algorithm>
#include <vector>

#include "base/statistics.h"

namespace veneer::capture {

ExposureCheck check_exposure(const CameraFrame& frame) {
  ExposureCheck check;
  if (frame.counts.empty() || frame.full_scale == 0) return check;
  std::vector<double> brightest;
  brightest.reserve(frame.counts.pixels().size());
  std::size_t saturated = 0;
  for (const Rgb16& pixel : frame.counts.pixels()) {
    const std::uint16_t value = *std::ranges::max_element(pixel);
    if (value >= frame.full_scale) ++saturated;
    brightest.push_back(static_cast<double>(value) / frame.full_scale);
  }
  check.saturated_fraction = static_cast<double>(saturated) / static_cast<double>(brightest.size());
  check.p99 = quantile(brightest, 0.99);
  check.median = quantile(std::move(brightest), 0.5);
  return check;
}

double better_exposure(const CameraFrame& frame) {
  constexpr double kWanted = 0.7;
  constexpr double kNearlyBlack = 0.02;  // below it offset and noise are most of what is read
  constexpr double kNearlyFull = 0.98;
  const double p99 = check_exposure(frame).p99;
  if (p99 >= kNearlyFull) return frame.exposure_s / 4;
  if (p99 < kNearlyBlack) return frame.exposure_s * 16;
  return frame.exposure_s * kWanted / p99;
}

}  // namespace veneer::capture
