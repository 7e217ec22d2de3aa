// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/v4l2/v4l2_camera.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "capture/cameras/v4l2/internal_node.h"

// What needs a camera is in v4l2_lab_test.cc.
namespace veneer::capture {
namespace {

using ::testing::HasSubstr;

Result<std::unique_ptr<Camera>> open(const std::string& text) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "test"));
  return open_v4l2(toml);
}

TEST(FormatCode, ComesBackAsItsName) {
  for (const char* name : {"YUYV", "MJPG", "GREY", "Y16", "Y8"}) {
    const auto code = format_code(name);
    ASSERT_TRUE(code) << name;
    EXPECT_EQ(format_name(*code), name);
  }
  EXPECT_EQ(*format_code("Y16"), std::uint32_t{V4L2_PIX_FMT_Y16});
  EXPECT_EQ(*format_code("MJPG"), std::uint32_t{V4L2_PIX_FMT_MJPEG});
}

TEST(FormatCode, RefusesWhatIsNone) {
  for (const char* name : {"", "YUYV2", "Y 6", "Y\n"}) {
    const auto code = format_code(name);
    ASSERT_FALSE(code) << name;
    EXPECT_EQ(code.error().code, Errc::kInvalidOption);
  }
}

TEST(V4l2Camera, SaysWhatIsWrongWithADevice) {
  const auto missing = open("device = \"/dev/nonexistent-camera\"");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, Errc::kNotFound);
  for (const char* other : {"/dev/null", "/dev/ptmx"}) {
    const auto foreign = open(fmt::format("device = \"{}\"", other));
    ASSERT_FALSE(foreign);
    EXPECT_EQ(foreign.error().code, Errc::kInvalidOption) << foreign.error().what;
    EXPECT_THAT(foreign.error().what, HasSubstr("no video device"));
  }
  const TemporaryFolder folder;
  ASSERT_TRUE(write_text(folder.path() / "file", "x"));
  const auto file = open(fmt::format("device = \"{}\"", (folder.path() / "file").string()));
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().code, Errc::kInvalidOption) << file.error().what;
}

TEST(V4l2Camera, RefusesValuesThatNoCameraHas) {
  for (const char* text : {"width = 640",
                           "width = 0\nheight = 480",
                           "width = 640\nheight = -1",
                           "fps = 0",
                           "fps = -5",
                           "bits = 8",
                           "bits = 17"}) {
    const auto camera = open(std::string("device = \"/dev/null\"\n") + text);
    ASSERT_FALSE(camera) << text;
    EXPECT_EQ(camera.error().code, Errc::kInvalidOption) << text;
    EXPECT_THAT(camera.error().what, ::testing::Not(HasSubstr("no video device"))) << text;
  }
}

TEST(V4l2Devices, AreNoneWhereTheKernelShowsNone) {
  const TemporaryFolder empty;
  EXPECT_TRUE(v4l2_devices(empty.path()).empty());
  EXPECT_TRUE(v4l2_devices(empty.path() / "absent").empty());
}

}  // namespace
}  // namespace veneer::capture
