// SPDX-License-Identifier: Apache-2.0
#include "calibration/exchange/cube.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "base/testing/temporary_folder.h"

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

/// Of sums of eight products of numbers near 1.
constexpr double kRoundingTolerance = 1e-12;
/// What nine significant digits keep of three values up to 1.25.
constexpr double kNineDigits = 2e-8;

const std::string kTwo = "LUT_3D_SIZE 2\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n";

Eigen::Vector3d random_rgb(Pcg32& random) {
  const auto uniform = [&] { return random.uniform(); };
  return {uniform(), uniform(), uniform()};
}

std::string refusal(const std::string& text) {
  const auto read = parse_cube(text, "x.cube");
  if (read) return "it was read";
  EXPECT_EQ(read.error().code, Errc::kBadFormat);
  EXPECT_THAT(read.error().what, HasSubstr("reading x.cube"));
  return read.error().what;
}

TEST(Cube, RedRunsFastest) {
  const auto table = parse_cube(kTwo, "x");
  ASSERT_TRUE(table) << table.error().what;
  Pcg32 random(3);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d rgb = random_rgb(random);
    EXPECT_LT(((*table)(rgb)-rgb).norm(), kRoundingTolerance) << rgb.transpose();
  }
}

TEST(Cube, AFunctionLinearInEachChannelIsExactBetweenNodes) {
  const auto function = [](const Eigen::Vector3d& v) {
    return Eigen::Vector3d(v.x() * v.y() * v.z(), v.x() - 2 * v.y() + 0.5, v.z() * v.x());
  };
  const CubeTable table = CubeTable::sampled(4, function);
  Pcg32 random(5);
  for (int i = 0; i < 200; ++i) {
    // Products of channels are linear in each one within a cell of a grid that holds them exactly.
    const Eigen::Vector3d rgb = random_rgb(random);
    EXPECT_LT((table(rgb) - function(rgb)).norm(), kRoundingTolerance) << rgb.transpose();
  }
}

TEST(Cube, BeyondItsDomainItIsClampedAndNanStaysNan) {
  CubeTable table = CubeTable::sampled(3, [](const Eigen::Vector3d& v) { return v; });
  table.domain_min = {-1, 0, 2};
  table.domain_max = {1, 4, 3};
  EXPECT_TRUE(table({-5, -5, -5}).isZero(kRoundingTolerance));
  EXPECT_TRUE(table({5, 5, 5}).isOnes(kRoundingTolerance));
  EXPECT_TRUE(table({0, 1, 2.75}).isApprox(Eigen::Vector3d(0.5, 0.25, 0.75)));
  EXPECT_TRUE(table({0, std::nan(""), 0}).hasNaN());
  EXPECT_TRUE(table({INFINITY, 0, 2}).allFinite());
}

TEST(Cube, WhatIsWrittenIsReadAgain) {
  CubeTable grid = CubeTable::sampled(
      5, [](const Eigen::Vector3d& v) { return v.array().sqrt().matrix() * 1.25; });
  grid.title = "what the projector sends";
  grid.domain_max = {1, 2, 1};
  CubeTable curves{CubeTable::Kind::k1d,
                   3,
                   "",
                   Eigen::Vector3d::Zero(),
                   Eigen::Vector3d::Ones(),
                   {{0, 0.25, 0}, {0.5, 0.125, 0.3}, {1, 1, 1e-7}}};
  const TemporaryFolder folder;
  for (const CubeTable& table : {grid, curves}) {
    const auto path = folder.path() / "x.cube";
    ASSERT_TRUE(write_cube(path, table));
    const auto read = read_cube(path);
    ASSERT_TRUE(read) << read.error().what;
    EXPECT_EQ(read->kind, table.kind);
    EXPECT_EQ(read->title, table.title);
    EXPECT_EQ(read->domain_max, table.domain_max);
    ASSERT_EQ(read->values.size(), table.values.size());
    for (std::size_t i = 0; i < table.values.size(); ++i)
      EXPECT_LT((read->values[i] - table.values[i]).norm(), kNineDigits) << i;
  }
}

TEST(Cube, WhatOtherProgramsWriteBesideIsUnderstood) {
  const auto table = parse_cube(
      "\r\n# made by hand\r\nTITLE \"t\"\r\nLUT_1D_SIZE 2\r\nLUT_1D_INPUT_RANGE 0.0 2.0\r\n"
      "\t0.0   0.0\t0.0\r\n+1e0 .5 1\r\n\r\n",
      "x");
  ASSERT_TRUE(table) << table.error().what;
  EXPECT_EQ(table->kind, CubeTable::Kind::k1d);
  EXPECT_TRUE((*table)({1, 1, 1}).isApprox(Eigen::Vector3d(0.5, 0.25, 0.5)));
}

TEST(Cube, WhatIsNoTableIsRefusedWithItsLine) {
  EXPECT_THAT(refusal(""), HasSubstr("neither"));
  EXPECT_THAT(refusal("0 0 0\n"), HasSubstr("line 1: values come before"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 1000000000\n"), HasSubstr("line 1: the size"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 1\n0 0 0\n"), HasSubstr("the size"));
  EXPECT_THAT(refusal("LUT_3D_SIZE two\n"), HasSubstr("the size"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 2\nLUT_1D_SIZE 2\n"), HasSubstr("second size"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 2\n0 0 nan\n"), HasSubstr("line 2"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 2\n0 0 inf\n"), HasSubstr("three finite"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 2\n0 0\n"), HasSubstr("three finite"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 2\n0 0 0 0\n"), HasSubstr("three finite"));
  EXPECT_THAT(refusal("LUT_3D_SIZE 2\n0 0 1e999\n"), HasSubstr("three finite"));
  EXPECT_THAT(refusal(kTwo + "1 1 1\n"), HasSubstr("more values"));
  EXPECT_THAT(refusal(kTwo.substr(0, kTwo.size() - 6)), HasSubstr("has 8 values, not 7"));
  EXPECT_THAT(refusal(kTwo + "TITLE \"late\"\n"), HasSubstr("after the values"));
  EXPECT_THAT(refusal("TITLE \"open\n" + kTwo), HasSubstr("quotes"));
  EXPECT_THAT(refusal("DOMAIN_MIN 1 0 0\n" + kTwo), HasSubstr("domain"));
  EXPECT_THAT(refusal("DOMAIN_MAX 1 nan 1\n" + kTwo), HasSubstr("finite"));
  EXPECT_THAT(refusal("LUT_4D_SIZE 2\n"), HasSubstr("LUT_4D_SIZE is not known"));
  EXPECT_THAT(refusal("\xFF\xFE\x01\n"), HasSubstr("line 1"));
}

TEST(Cube, WhatMakesNoTableIsNotWritten) {
  CubeTable table = CubeTable::sampled(2, [](const Eigen::Vector3d& v) { return v; });
  EXPECT_TRUE(cube_text(table));
  CubeTable broken = table;
  broken.values[3].y() = std::nan("");
  EXPECT_FALSE(cube_text(broken));
  broken = table;
  broken.values.pop_back();
  EXPECT_FALSE(cube_text(broken));
  broken = table;
  broken.domain_min.x() = 1;
  EXPECT_FALSE(cube_text(broken));
  broken = table;
  broken.title = "two\nlines";
  EXPECT_FALSE(cube_text(broken));
  EXPECT_FALSE(cube_text({}));
}

}  // namespace
}  // namespace veneer::calibration
