// SPDX-License-Identifier: Apache-2.0
#include "btf/direction.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <numbers>

#include "base/files.h"
#include "btf/internal_test_sets.h"

namespace veneer::btf {
namespace {

// Sines, cosines and arcus tangents of unit-sized numbers in double precision.
constexpr double kRounding = 1e-14;

TEST(Angles, RoundTripOverTheSphere) {
  Pcg32 random(1);
  for (int i = 0; i < 2000; ++i) {
    const Direction d = testing::random_direction(random, -1.0);
    const Angles angles = angles_from_direction(d);
    EXPECT_GE(angles.phi, 0.0);
    EXPECT_LT(angles.phi, 2.0 * std::numbers::pi);
    EXPECT_LT((direction_from_angles(angles) - d).norm(), kRounding) << d.transpose();
  }
}

TEST(Angles, KeepTheirPrecisionNextToTheNormal) {
  const Angles angles = angles_from_direction(direction_from_angles({1e-9, 1.0}));
  EXPECT_NEAR(angles.theta, 1e-9, 1e-22);
  EXPECT_NEAR(angles.phi, 1.0, kRounding);
}

TEST(Angles, EdgesOfTheDomain) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(angles_from_direction({0, 0, 1}).phi, 0.0);
  EXPECT_EQ(angles_from_direction({0, 0, 0}).theta, 0.0);
  EXPECT_EQ(angles_from_direction({kNan, 0, 1}).theta, 0.0);
  EXPECT_DOUBLE_EQ(angles_from_direction({0, 0, -1}).theta, std::numbers::pi);
  // Just below the full turn: still in [0, 2 pi).
  EXPECT_LT(angles_from_direction({1, -1e-300, 0}).phi, 2.0 * std::numbers::pi);
  // Length does not matter.
  EXPECT_NEAR(angles_from_direction({0, 3, 3}).theta, std::numbers::pi / 4.0, kRounding);
}

TEST(BonnDirections, AreTheRingsOfTheMeasurement) {
  const DirectionSet set = bonn_directions();
  ASSERT_EQ(set.size(), 81U);
  EXPECT_FALSE(find_equal_directions(set));
  EXPECT_NEAR(angles_from_direction(set[0]).theta, 0.0, kRounding);
  EXPECT_NEAR(set[1].y(), 0.0, kRounding);  // first azimuth 0
  EXPECT_NEAR(angles_from_direction(set[2]).phi, std::numbers::pi / 3.0, kRounding);  // 6 in a ring
  EXPECT_NEAR(angles_from_direction(set[80]).theta, 75.0 * std::numbers::pi / 180.0, kRounding);
}

TEST(Ubo2014Directions, AreTheRingsOfTheMeasurement) {
  const DirectionSet set = ubo2014_directions();
  ASSERT_EQ(set.size(), 151U);
  EXPECT_FALSE(find_equal_directions(set));
  std::map<int, int> counts;  // by theta in tenths of a degree
  for (const Direction& d : set)
    ++counts[static_cast<int>(
        std::lround(angles_from_direction(d).theta * 1800.0 / std::numbers::pi))];
  const std::map<int, int> expected{{0, 1},
                                    {110, 6},
                                    {235, 12},
                                    {300, 12},
                                    {375, 12},
                                    {450, 18},
                                    {525, 18},
                                    {600, 24},
                                    {675, 24},
                                    {750, 24}};
  EXPECT_EQ(counts, expected);
}

// The measured list as it stands beside a set of the same laboratory: 151 x, then y, z, in double.
TEST(Ubo2014Directions, AreThoseOfTheRealFile) {
  const char* data = std::getenv("VENEER_DATA");
  const std::filesystem::path path =
      std::filesystem::path(data == nullptr ? "" : data) / "sparsebtf_carpet07" / "xyz_loc.bin";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "real data absent: " << path;
  const std::string bytes = read_text(path).value();
  ASSERT_GE(bytes.size(), 3 * 151 * sizeof(double));
  std::vector<double> xyz(3 * 151);
  std::memcpy(xyz.data(), bytes.data(), xyz.size() * sizeof(double));
  const DirectionSet set = ubo2014_directions();
  for (std::size_t i = 0; i < 151; ++i) {
    const Direction real(xyz[i], xyz[151 + i], xyz[302 + i]);
    double nearest = 2.0;
    for (const Direction& d : set) nearest = std::min(nearest, (d - real).norm());
    EXPECT_LT(nearest, 1e-5) << i << ": " << real.transpose();  // the file comes from float
  }
}

TEST(FindEqualDirections, NamesTheFirstPair) {
  DirectionSet set = bonn_directions();
  set.push_back(set[5]);
  const auto equal = find_equal_directions(set);
  ASSERT_TRUE(equal);
  EXPECT_EQ(*equal, (std::pair{5, 81}));
}

TEST(DirectionFiles, RoundTrip) {
  const TemporaryFolder folder;
  const DirectionSet set = bonn_directions();
  ASSERT_TRUE(write_directions(folder.path() / "d.csv", set));
  const auto read = read_directions(folder.path() / "d.csv");
  ASSERT_TRUE(read) << read.error().what;
  ASSERT_EQ(read->size(), set.size());
  for (std::size_t i = 0; i < set.size(); ++i) EXPECT_LT((set[i] - (*read)[i]).norm(), kRounding);
}

TEST(DirectionFiles, ReadsSpacesAndWindowsLineEnds) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "d.csv", "theta,phi\r\n 30 , 90\r\n\r\n90,0"));
  const auto read = read_directions(folder.path() / "d.csv");
  ASSERT_TRUE(read) << read.error().what;
  ASSERT_EQ(read->size(), 2U);
  EXPECT_NEAR((*read)[0].y(), 0.5, kRounding);
}

struct BadFile {
  const char* name;
  const char* text;
  const char* says;
};

class BadDirectionFile : public ::testing::TestWithParam<BadFile> {};

TEST_P(BadDirectionFile, IsRefusedNamingTheLine) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "d.csv", GetParam().text));
  const auto read = read_directions(folder.path() / "d.csv");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, Errc::kBadFormat);
  EXPECT_NE(read.error().what.find(GetParam().says), std::string::npos) << read.error().what;
}

INSTANTIATE_TEST_SUITE_P(All,
                         BadDirectionFile,
                         ::testing::Values(BadFile{"header", "phi,theta\n1,2\n", "line 1"},
                                           BadFile{"empty", "", "no direction"},
                                           BadFile{"only_header", "theta,phi\n", "no direction"},
                                           BadFile{"one_number", "theta,phi\n0,0\n5\n", "line 3"},
                                           BadFile{"three_numbers", "theta,phi\n5,6,7\n", "line 2"},
                                           BadFile{"word", "theta,phi\n5,north\n", "line 2"},
                                           BadFile{"nan", "theta,phi\nnan,0\n", "line 2"},
                                           BadFile{"below_horizon", "theta,phi\n91,0\n", "line 2"}),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

TEST(DirectionFiles, MissingFileIsNotFound) {
  const TemporaryFolder folder;
  const auto read = read_directions(folder.path() / "none.csv");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, Errc::kNotFound);
}

}  // namespace
}  // namespace veneer::btf
