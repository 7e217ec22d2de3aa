// SPDX-License-Identifier: Apache-2.0
#include "cli/picture_size.h"

#include <gtest/gtest.h>

namespace veneer::cli {
namespace {

TEST(PictureSize, IsTwoNumbersWithAnXBetween) {
  const auto size = parse_size("640x48");
  ASSERT_TRUE(size) << size.error().what;
  EXPECT_EQ(size->width, 640);
  EXPECT_EQ(size->height, 48);
}

TEST(PictureSize, AnythingElseIsRefused) {
  for (const char* text : {"",
                           "x",
                           "640",
                           "640x",
                           "x480",
                           "640x480x",
                           "640 x 480",
                           "640x480 ",
                           "+640x480",
                           "-1x5",
                           "0x480",
                           "640x0",
                           "99999999999x600",
                           "600x99999999999",
                           "640X480",
                           "6.5x4"}) {
    const auto size = parse_size(text);
    ASSERT_FALSE(size) << text;
    EXPECT_EQ(size.error().code, Errc::kInvalidOption);
  }
}

TEST(PictureSize, SidesHaveBounds) {
  EXPECT_TRUE(parse_size("16x8192", 16, 8192));
  EXPECT_FALSE(parse_size("15x8192", 16, 8192));
  EXPECT_FALSE(parse_size("16x8193", 16, 8192));
  EXPECT_NE(parse_size("1x1", 16, 8192).error().what.find("16 to 8192"), std::string::npos);
}

}  // namespace
}  // namespace veneer::cli
