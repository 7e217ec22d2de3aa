// SPDX-License-Identifier: Apache-2.0
#include "cli/report/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/colour.h"
#include "base/result.h"

namespace veneer::cli {
namespace {

std::uint8_t to_byte(double value) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
}

/// Dark blue, blue, teal, green, yellow: lightness grows all the way, so that it reads in grey too.
Rgb8 scale_colour(double place) {
  static constexpr std::array<std::array<double, 3>, 5> kStops{{{0.09, 0.07, 0.26},
                                                                {0.16, 0.29, 0.56},
                                                                {0.10, 0.53, 0.55},
                                                                {0.42, 0.77, 0.37},
                                                                {0.99, 0.91, 0.20}}};
  const double scaled = std::clamp(place, 0.0, 1.0) * (kStops.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(scaled), kStops.size() - 2);
  const double part = scaled - static_cast<double>(below);
  Rgb8 colour{};
  for (std::size_t c = 0; c < 3; ++c) {
    colour[c] = to_byte((1 - part) * kStops[below][c] + part * kStops[below + 1][c]);
  }
  return colour;
}

}  // namespace

Image<Rgb8> picture_of_xyz(ImageView<const Rgb32f> xyz, double white_luminance) {
  VENEER_CHECK(white_luminance > 0);
  Image<Rgb8> picture(xyz.width(), xyz.height());
  for (int y = 0; y < xyz.height(); ++y) {
    for (int x = 0; x < xyz.width(); ++x) {
      const Eigen::Vector3d rgb = srgb_from_xyz() * xyz(x, y).cast<double>() / white_luminance;
      for (int c = 0; c < 3; ++c)
        picture(x, y)[static_cast<std::size_t>(c)] = to_byte(srgb_encode(rgb[c]));
    }
  }
  return picture;
}

Image<Rgb8> picture_of_codes(ImageView<const Rgb16> codes, int bits) {
  const double full = (1U << static_cast<unsigned>(bits)) - 1;
  Image<Rgb8> picture(codes.width(), codes.height());
  for (int y = 0; y < codes.height(); ++y) {
    for (int x = 0; x < codes.width(); ++x) {
      for (std::size_t c = 0; c < 3; ++c) {
        picture(x, y)[c] = to_byte(codes(x, y)[c] / full);
      }
    }
  }
  return picture;
}

Image<Rgb8> picture_of_differences(ImageView<const float> de00, double most) {
  constexpr Rgb8 kNotCounted{70, 70, 70};
  Image<Rgb8> picture(de00.width(), de00.height());
  for (int y = 0; y < de00.height(); ++y) {
    for (int x = 0; x < de00.width(); ++x) {
      picture(x, y) = std::isnan(de00(x, y)) ? kNotCounted : scale_colour(de00(x, y) / most);
    }
  }
  return picture;
}

Image<Rgb8> difference_legend(int width, int height) {
  Image<Rgb8> legend(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) legend(x, y) = scale_colour((x + 0.5) / width);
  }
  return legend;
}

}  // namespace veneer::cli
