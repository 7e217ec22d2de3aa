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
  /// Counts that lie at or above this are saturated and tell nothing; 0: the pictures' own maximum
  /// is not taken for saturation.
  std::uint16_t full_scale = 0;
  /// A difference of two counts that is below so many of its standard deviations is no bit. 3: one
  /// of 400 differences of pure noise passes, and 20 of them would have to.
  double least_deviations = 3;
  /// A pixel is lit if white exceeds black by this part of the 95th percentile of that excess (and
  /// by twice `least_deviations`): what is less is light that came by way of other surfaces.
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
  Image<std::uint8_t> lit;  ///< 1 where the projector's white makes a difference
  /// Of the lit pixels: those decoded.
  double decoded_ratio = 0;
  double lit_ratio = 0;  ///< of all pixels
  /// Of every picture: the part of the lit pixels at which its bit is sure (or, of a sinusoid,
  /// modulates enough); 1 for white and black. A picture that was shown or grabbed wrongly stands
  /// out here.
  std::vector<double> pattern_ratio;
  double noise_counts = 0;  ///< standard deviation of a count, estimated from the pictures
};

/// Errors: kInvalidOption (as many pictures as the plan says, all of one size, or else the text
/// says which is not), kBadFormat (nothing is lit: white and black do not differ). Deterministic
/// whatever the number of threads.
[[nodiscard]] Result<DecodedView> decode(std::span<const GreyPicture> pictures,
                                         const PatternPlan& plan,
                                         const DecodingOptions& options = {});

}  // namespace veneer::geometry
