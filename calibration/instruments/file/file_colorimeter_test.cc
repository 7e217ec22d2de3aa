// SPDX-License-Identifier: Apache-2.0
#include "calibration/instruments/file/file_colorimeter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace veneer::calibration {
namespace {

using ::testing::HasSubstr;

class AnyDisplay final : public PatchDisplay {
 public:
  Status show(const Rgb16& code, bool /*lit*/) override {
    if (code[0] > 255) return fail(Errc::kInvalidOption, "no such code");
    return {};
  }
  Status show_picture(ImageView<const Rgb16> /*codes*/) override { return {}; }
};

MeasuredPatches readings() {
  return {"a meter",
          {{{0, 0, 0}, {0.1, 0.1, 0.1}},
           {{1, 1, 1}, {90, 100, 80}},
           {{0.5, 0.5, 0.5}, {20, 22, 18}},
           {{1, 1, 1}, {91, 101, 81}},
           {{0.502, 0.5, 0.5}, {21, 23, 19}}}};
}

class FileColorimeterTest : public ::testing::Test {
 protected:
  Result<Xyz> read(Target target = Target::kWhiteReference) {
    return colorimeter_.read(target, Eigen::Vector2d::Zero());
  }
  std::string complaint(Target target = Target::kWhiteReference) {
    const auto xyz = read(target);
    EXPECT_FALSE(xyz);
    if (xyz) return "";
    EXPECT_EQ(xyz.error().code, Errc::kNotFound);
    return xyz.error().what;
  }
  AnyDisplay display_;
  WatchedDisplay watched_{display_, 8};
  FileColorimeter colorimeter_{readings(), std::nullopt, watched_};
};

TEST_F(FileColorimeterTest, GivesWhatWasReadOfThePatchThatIsShown) {
  ASSERT_TRUE(watched_.show({0, 0, 0}));
  EXPECT_EQ(read().value(), Xyz(0.1, 0.1, 0.1));
  ASSERT_TRUE(watched_.show({127, 127, 127}));  // 0.498: 0.5 is within reach, 0.502 is not
  EXPECT_EQ(read().value(), Xyz(20, 22, 18));
}

TEST_F(FileColorimeterTest, ReadingsOfOnePatchComeInTurn) {
  ASSERT_TRUE(watched_.show({255, 255, 255}));
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(read().value(), Xyz(90, 100, 80));
    EXPECT_EQ(read().value(), Xyz(91, 101, 81));
  }
}

TEST_F(FileColorimeterTest, AMissingPatchIsNamed) {
  ASSERT_TRUE(watched_.show({51, 0, 255}));
  EXPECT_THAT(complaint(), HasSubstr("0.2000 0.0000 1.0000"));
  ASSERT_TRUE(watched_.show({126, 126, 126}));  // one step beside 0.5
  EXPECT_THAT(complaint(), HasSubstr("0.4941"));
}

TEST_F(FileColorimeterTest, WhatNoFileKnowsIsSaid) {
  EXPECT_THAT(complaint(), HasSubstr("shows no uniform patch"));
  ASSERT_TRUE(watched_.show({0, 0, 0}, false));
  EXPECT_THAT(complaint(), HasSubstr("lamp is off"));
  ASSERT_TRUE(watched_.show({0, 0, 0}));
  EXPECT_THAT(complaint(Target::kObject), HasSubstr("white reference alone"));
  ASSERT_TRUE(watched_.show_picture({}));
  EXPECT_THAT(complaint(), HasSubstr("shows no uniform patch"));
  ASSERT_TRUE(watched_.show({0, 0, 0}));
  EXPECT_FALSE(watched_.show({256, 0, 0}));  // refused: what is shown is not known any more
  EXPECT_THAT(complaint(), HasSubstr("shows no uniform patch"));
}

TEST_F(FileColorimeterTest, TheObjectHasReadingsOfItsOwn) {
  FileColorimeter both(readings(), MeasuredPatches{"", {{{0, 0, 0}, {5, 5, 5}}}}, watched_);
  ASSERT_TRUE(watched_.show({0, 0, 0}));
  EXPECT_EQ(both.read(Target::kObject, Eigen::Vector2d::Zero()).value(), Xyz(5, 5, 5));
  EXPECT_EQ(both.read(Target::kWhiteReference, Eigen::Vector2d::Zero()).value(),
            Xyz(0.1, 0.1, 0.1));
}

}  // namespace
}  // namespace veneer::calibration
