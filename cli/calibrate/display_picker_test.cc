// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate/display_picker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

namespace veneer::cli {
namespace {

constexpr Rgb16 kWhite{255, 255, 255};

bool has_rim(const Image<Rgb16>& p) {
  for (int x = 0; x < p.width(); ++x)
    if (p(x, 0) != kWhite || p(x, p.height() - 1) != kWhite) return false;
  for (int y = 0; y < p.height(); ++y)
    if (p(0, y) != kWhite || p(p.width() - 1, y) != kWhite) return false;
  return true;
}

/// The picture without its rim.
std::vector<Rgb16> inside(const Image<Rgb16>& p) {
  std::vector<Rgb16> pixels;
  for (int y = 1; y < p.height() - 1; ++y)
    for (int x = 1; x < p.width() - 1; ++x) pixels.push_back(p(x, y));
  return pixels;
}

TEST(NumberPicture, TellsNumbersApartAtAnySize) {
  for (const auto& [width, height] :
       {std::pair{16, 16}, {64, 48}, {100, 640}, {640, 100}, {1920, 1080}}) {
    std::set<std::vector<Rgb16>> seen;
    for (int number = 0; number < 12; ++number) {
      if (width < 40 && number > 9) break;  // two digits do not fit sixteen pixels
      const Image<Rgb16> picture = number_picture(number, width, height);
      ASSERT_EQ(picture.width(), width);
      ASSERT_EQ(picture.height(), height);
      EXPECT_TRUE(has_rim(picture)) << width << " x " << height;
      EXPECT_TRUE(seen.insert(inside(picture)).second) << number << " at " << width;
    }
  }
}

TEST(NumberPicture, FillsMostOfTheHeightOfAWideDisplay) {
  const Image<Rgb16> picture = number_picture(8, 1920, 1080);
  int first = picture.height();
  int last = 0;
  for (int y = 1; y < picture.height() - 1; ++y) {
    for (int x = 1; x < picture.width() - 1; ++x) {
      if (picture(x, y) != kWhite) continue;
      first = std::min(first, y);
      last = std::max(last, y);
    }
  }
  EXPECT_GT(last - first, 1080 * 2 / 3);
}

}  // namespace
}  // namespace veneer::cli
