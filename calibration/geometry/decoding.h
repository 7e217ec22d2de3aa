// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "calibration/geometry/patterns.h"

namespace veneer::geometry {

/// Grey counts of a camera, 8 to 16 bits, in whatever scale: thresholds come from the pictures.
using GreyPicture = Image<std::uint16_t>;

/// The mean of the channels, for cameras that give colour; exact where all three are alike.
[[nodiscard]] GreyPicture grey_of(ImageView<const Rgb16> counts);

struct DecodingOptions {
  /// Counts that lie at or above this are saturated, which spoils a sinusoid; 0: none is.
  std::uint16_t full_scale = 0;
  /// A difference of two counts that is below so many of its standard deviations is no bit. 3: one
  /// of 400 differences of pure noise passes, and 20 of them would have to.
  double least_deviations = 3;
  /// A pixel is lit if the light that comes to it straight from the projector, which is what bits
  /// differ by, is above this part of that light's 95th percentile, and above four times
  /// `least_deviations`. What is less came by way of other surfaces or cannot be told from noise.
  double least_lit = 0.03;
  /// A bit is unsure if its contrast is below this part of white minus black.
  double least_contrast = 0.1;

  [[nodiscard]] Status check() const;  ///< Errors: kInvalidOption
};

/// Where on the projector's raster each camera pixel's light came from.
struct DecodedView {
  /// Projector pixels, first centre (0.5, 0.5); NaN where nothing was decoded. A block of Gray code
  /// counts as its middle, step * code + step / 2; where just one bit is unsure, and so lies on the
  /// border of two neighbouring blocks, as that border.
  Image<Eigen::Vector2f> projector;
  /// 0 where nothing was decoded, else up to 1: the least contrast of all bits relative to white
  /// minus black, after three deviations of noise were taken off.
  Image<float> confidence;
  Image<std::uint8_t> lit;  ///< 1 where the projector lights straight
  /// Of the lit pixels: those decoded.
  double decoded_ratio = 0;
  double lit_ratio = 0;  ///< of all pixels
  /// Of every picture: the part of the lit pixels at which its bit is sure (or, of a sinusoid,
  /// modulates enough); 1 for white and black. A picture that was shown or grabbed wrongly stands
  /// out here.
  std::vector<double> pattern_ratio;
  double noise_counts = 0;  ///< standard deviation of a lit pixel's count, from the pictures
  /// What a position may be off by design: a Gray code's block, or a pixel with sinusoids.
  double resolution_px = 1;
};

/// Errors: kInvalidOption (as many pictures as the plan says, all of one size, or else the text
/// says which is not), kBadFormat (nothing is lit: white and black do not differ). Deterministic
/// whatever the number of threads.
[[nodiscard]] Result<DecodedView> decode(std::span<const GreyPicture> pictures,
                                         const PatternPlan& plan,
                                         const DecodingOptions& options = {});

}  // namespace veneer::geometry
