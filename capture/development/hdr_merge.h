// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "base/image.h"
#include "base/result.h"
#include "capture/development/response.h"
#include "capture/recording.h"

namespace veneer::capture {

/// Noise of one frame's count, as variance = read^2 + signal / electrons_per_count, plus that of
/// rounding to whole counts.
struct NoiseModel {
  double electrons_per_count = 1;
  double read_noise_counts = 1;

  /// Variance of a frame at this many counts above dark; >= that of read noise.
  [[nodiscard]] double variance(double counts) const;
};
/// By photon transfer (Janesick 2007): variance of differences against means, robustly over all
/// pixels, from pictures that repeat the same exposure; counts are taken from the dark pictures
/// among them, where there are any. Errors: kInvalidOption (no pair of equal exposure), kBadFormat
/// (too small a range of light).
[[nodiscard]] Result<NoiseModel> measure_noise(std::span<const Picture> pictures);

/// Light in parts of what saturates the camera in one second, dark taken off.
struct MergedPicture {
  Image<Rgb32f> light;     ///< may be negative by noise
  Image<Rgb32f> variance;  ///< of it
  /// Bit c set: channel c was saturated in every exposure; its light is 0 and its variance
  /// infinite. It is never guessed.
  Image<std::uint8_t> saturated;
  double saturated_fraction = 0;
  Mosaic mosaic = Mosaic::kNone;
};

/// Merges a bracket, each exposure weighted by the inverse of its variance, which is taken from the
/// merged light and not from the single noisy count, so that the mean has no bias (with a curved
/// response: none of the first order of noise).
/// @param lit   one or more exposures.   @param dark  of each, the same exposure without light.
/// Errors: kInvalidOption (no pictures; a dark one missing; sizes or exposures that differ).
[[nodiscard]] Result<MergedPicture> merge(std::span<const Picture> lit,
                                          std::span<const Picture> dark,
                                          const ResponseCurve& response,
                                          const NoiseModel& noise);

}  // namespace veneer::capture
