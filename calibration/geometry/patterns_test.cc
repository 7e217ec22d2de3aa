// SPDX-License-Identifier: Apache-2.0
#include "calibration/geometry/patterns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <set>

#include "base/image_files.h"

namespace veneer::geometry {
namespace {

TEST(GrayCode, TellsEveryBlockFromEveryOther) {
  for (const auto& [width, height, step] : {std::array{37, 21, 1}, {64, 48, 4}, {10, 9, 3}}) {
    const PatternPlan plan = gray_code_plan(width, height, step).value();
    std::set<std::vector<double>> codes;
    for (int y = 0; y < height; y += step) {
      for (int x = 0; x < width; x += step) {
        std::vector<double> code;
        for (int i = 0; i < plan.pictures(); ++i) code.push_back(pattern_level(plan, i, x, y));
        codes.insert(code);
      }
    }
    const int blocks = ((width + step - 1) / step) * ((height + step - 1) / step);
    EXPECT_EQ(codes.size(), static_cast<std::size_t>(blocks)) << width << " x " << height;
  }
}

TEST(GrayCode, ChangesOneBitBetweenNeighbours) {
  const PatternPlan plan = gray_code_plan(100, 30, 1).value();
  for (int x = 0; x + 1 < 100; ++x) {
    int changes = 0;
    for (int i = 0; i < 2 * plan.column_bits; i += 2)
      changes += pattern_level(plan, i, x, 0) != pattern_level(plan, i, x + 1, 0) ? 1 : 0;
    EXPECT_EQ(changes, 1) << x;
  }
}

TEST(GrayCode, FollowsEachPictureByItsInverse) {
  const PatternPlan plan = gray_code_plan(33, 17, 2).value();
  for (int i = 0; i + 2 < plan.pictures(); i += 2) {
    EXPECT_FALSE(plan.patterns[static_cast<std::size_t>(i)].inverse);
    EXPECT_TRUE(plan.patterns[static_cast<std::size_t>(i) + 1].inverse);
    for (int x = 0; x < 33; ++x)
      EXPECT_EQ(pattern_level(plan, i, x, 5) + pattern_level(plan, i + 1, x, 5), 1);
  }
}

TEST(GrayCode, IsTheOneThatTheRealDataWereTakenWith) {
  const char* data = std::getenv("VENEER_DATA");
  const std::filesystem::path folder =
      std::filesystem::path(data != nullptr ? data : "../shared/data") /
      "procam_graycode/graycode_pattern";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "real data absent: " << folder;
  const PatternPlan plan = gray_code_plan(1024, 768, 1).value();
  ASSERT_EQ(plan.pictures(), 42);
  for (const int i : {0, 1, 9, 18, 19, 20, 21, 38, 39, 40, 41}) {
    const auto shown = read_png(folder / fmt::format("pattern_{:02}.png", i));
    ASSERT_TRUE(shown) << shown.error().what;
    const Image<std::uint8_t> ours = draw_pattern(plan, i);
    ASSERT_EQ(shown->width(), ours.width());
    int different = 0;
    for (std::size_t k = 0; k < ours.pixels().size(); ++k)
      different += ours.pixels()[k] != shown->pixels()[k][0] ? 1 : 0;
    EXPECT_EQ(different, 0) << plan.patterns[static_cast<std::size_t>(i)].name();
  }
}

TEST(PhaseShift, AddsUpToTheSameEverywhere) {
  const PatternPlan plan = phase_shift_plan(64, 48, 16, 4).value();
  EXPECT_EQ(plan.step, 8);
  for (int x = 0; x < 64; ++x) {
    double sum = 0;
    for (int i = 0; i < plan.pictures(); ++i) {
      const Pattern& pattern = plan.patterns[static_cast<std::size_t>(i)];
      if (pattern.kind == PatternKind::kPhase && pattern.axis == PatternAxis::kColumns)
        sum += pattern_level(plan, i, x, 3);
    }
    EXPECT_NEAR(sum, 2, 1e-12) << x;
  }
}

TEST(DrawnCodes, UndoTheToneCurve) {
  constexpr int kBits = 10;
  std::vector<double> curve;
  for (int code = 0; code < 1 << kBits; ++code) curve.push_back(std::pow(code / 1023.0, 2.2));
  const PatternPlan plan = phase_shift_plan(64, 48, 16, 4).value();
  for (int i = 0; i < plan.pictures(); ++i) {
    const Image<Rgb16> codes = draw_pattern_codes(plan, i, kBits, curve);
    for (int x = 0; x < 64; ++x) {
      const Rgb16& code = codes(x, 7);
      EXPECT_EQ(code[0], code[1]);
      // Half of the steepest step of the curve, 2.2 / 1023.
      EXPECT_NEAR(curve[code[0]], pattern_level(plan, i, x, 7), 1.1e-3) << i << ", " << x;
    }
  }
}

TEST(DrawnCodes, AreBlackAndFullScaleForBits) {
  const PatternPlan plan = gray_code_plan(8, 8, 1).value();
  const Image<Rgb16> picture = draw_pattern_codes(plan, 0, 12);
  std::set<std::uint16_t> codes;
  for (const Rgb16& pixel : picture.pixels()) codes.insert(pixel[2]);
  EXPECT_EQ(codes, (std::set<std::uint16_t>{0, 4095}));
}

TEST(Plans, RefuseWhatCannotBeShown) {
  for (const auto& [width, height, step] :
       {std::array{1, 10, 1}, {10, 0, 1}, {-4, 8, 1}, {20000, 8, 1}, {64, 48, 0}, {64, 48, 25}})
    EXPECT_EQ(gray_code_plan(width, height, step).error().code, Errc::kInvalidOption);
  EXPECT_EQ(phase_shift_plan(64, 48, 15, 4).error().code, Errc::kInvalidOption);
  EXPECT_EQ(phase_shift_plan(64, 48, 2, 4).error().code, Errc::kInvalidOption);
  EXPECT_EQ(phase_shift_plan(64, 48, 16, 2).error().code, Errc::kInvalidOption);
}

}  // namespace
}  // namespace veneer::geometry
