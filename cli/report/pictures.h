// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/image.h"

namespace veneer::cli {

/// A luminance image as a picture for a screen: linear sRGB of XYZ / white_luminance, cut to what a
/// screen can show, encoded. @param xyz  cd/m^2.   @param white_luminance  shown as white; > 0.
[[nodiscard]] Image<Rgb8> picture_of_xyz(ImageView<const Rgb32f> xyz, double white_luminance);

/// Drive codes as they are, spread over 8 bits. @param bits  of a code, 1 to 16.
[[nodiscard]] Image<Rgb8> picture_of_codes(ImageView<const Rgb16> codes, int bits);

/// Colour differences from dark blue (0) over green to yellow (`most` and above); pixels that are
/// not counted (NaN) are grey.
[[nodiscard]] Image<Rgb8> picture_of_differences(ImageView<const float> de00, double most);

/// The colour scale of picture_of_differences from left to right, for a legend.
[[nodiscard]] Image<Rgb8> difference_legend(int width, int height);

}  // namespace veneer::cli
