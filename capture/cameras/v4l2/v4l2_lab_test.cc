// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <fstream>

#include "capture/cameras/v4l2/internal_node.h"
#include "capture/cameras/v4l2/v4l2_camera.h"

// Runs as root in the kernel lab (tests/lab/), where vivid, the kernel's own test driver, makes up
// /dev/video0, a webcam, and /dev/video1, an output. Elsewhere it would take a real camera away.
namespace veneer::capture {
namespace {

using ::testing::HasSubstr;

constexpr const char* kNode = "/dev/video0";

Result<std::unique_ptr<Camera>> open(const std::string& text, const char* node = kNode) {
  VENEER_ASSIGN(TomlReader toml,
                TomlReader::parse(fmt::format("device = \"{}\"\n{}", node, text), "test"));
  VENEER_ASSIGN(auto camera, open_v4l2(toml));
  VENEER_TRY(toml.finish());
  return camera;
}

TEST(V4l2Lab, ListsTheCameraAndNotTheOutput) {
  const auto cameras = list_v4l2();
  ASSERT_TRUE(cameras);
  ASSERT_EQ(cameras->size(), 1u);
  EXPECT_EQ(cameras->front().identity, kNode);
  EXPECT_THAT(cameras->front().model, HasSubstr("vivid"));
  EXPECT_EQ(cameras->front().state, "");
  const auto output = open("", "/dev/video1");
  ASSERT_FALSE(output);
  EXPECT_EQ(output.error().code, Errc::kInvalidOption);
  EXPECT_THAT(output.error().what, HasSubstr(kNode));
}

TEST(V4l2Lab, GivesPicturesThatBeganAfterTheCall) {
  const auto camera = open("format = \"YUYV\"\nwidth = 640\nheight = 360");
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_EQ((*camera)->width(), 640);
  EXPECT_EQ((*camera)->height(), 360);
  Time last{};
  for (int i = 0; i < 4; ++i) {
    // Long enough for the queue to be full of old ones.
    if (i == 2) ::usleep(700 * 1000);
    const Time before = SteadyClock().now();
    const auto frame = (*camera)->grab();
    ASSERT_TRUE(frame) << frame.error().what;
    EXPECT_GE(frame->time - from_seconds(frame->exposure_s) / 2, before);
    EXPECT_LE(frame->time, SteadyClock().now());
    EXPECT_GT(frame->time, last);
    last = frame->time;
    EXPECT_EQ(frame->full_scale, 255);
    EXPECT_EQ(frame->counts.width(), 640);
    EXPECT_EQ(frame->counts.height(), 360);
  }
}

TEST(V4l2Lab, KeepsTheOrderOfColours) {
  const auto camera = open("format = \"YUYV\"\nwidth = 640\nheight = 360");
  ASSERT_TRUE(camera) << camera.error().what;
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame) << frame.error().what;
  // Its picture is of eight bars: white, yellow, cyan, green, magenta, red, blue, black.
  const std::array<std::array<bool, 3>, 8> bars{{{true, true, true},
                                                 {true, true, false},
                                                 {false, true, true},
                                                 {false, true, false},
                                                 {true, false, true},
                                                 {true, false, false},
                                                 {false, false, true},
                                                 {false, false, false}}};
  for (int bar = 0; bar < 8; ++bar) {
    const Rgb16 colour = frame->counts(40 + 80 * bar, 350);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(colour[c] > 96, bars[static_cast<std::size_t>(bar)][c])
          << "bar " << bar << ", channel " << c << ": " << colour[c];
    }
  }
}

TEST(V4l2Lab, SixteenBitsBeginWithTheSameEight) {
  Image<Rgb16> grey;
  {
    const auto camera = open("format = \"GREY\"\nwidth = 640\nheight = 360");
    ASSERT_TRUE(camera) << camera.error().what;
    auto frame = (*camera)->grab();
    ASSERT_TRUE(frame) << frame.error().what;
    EXPECT_EQ(frame->full_scale, 255);
    grey = std::move(frame->counts);
  }
  const auto camera = open("format = \"Y16\"\nbits = 16\nwidth = 640\nheight = 360");
  ASSERT_TRUE(camera) << camera.error().what;
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame) << frame.error().what;
  EXPECT_EQ(frame->full_scale, 65535);
  int bright = 0;
  for (int x = 0; x < 640; ++x) {
    ASSERT_EQ(frame->counts(x, 350)[0] >> 8, grey(x, 350)[0]) << x;
    bright += grey(x, 350)[0] > 96 ? 1 : 0;
  }
  EXPECT_GT(bright, 80);
}

TEST(V4l2Lab, HasSwitchedItsAutomaticGainOff) {
  auto node = V4l2Node::open(kNode);
  ASSERT_TRUE(node);
  ASSERT_EQ(node->write(V4L2_CID_AUTOGAIN, 1), 0);
  const auto camera = open("gain = 17");
  ASSERT_TRUE(camera) << camera.error().what;
  std::int32_t value = -1;
  ASSERT_EQ(node->read(V4L2_CID_AUTOGAIN, value), 0);
  EXPECT_EQ(value, 0);
  ASSERT_EQ(node->read(V4L2_CID_GAIN, value), 0);
  EXPECT_EQ(value, 17);
}

TEST(V4l2Lab, SaysWhatTheCameraHasWhereItLacksWhatIsAskedFor) {
  const auto format = open("format = \"ZZZZ\"");
  ASSERT_FALSE(format);
  EXPECT_EQ(format.error().code, Errc::kInvalidOption);
  EXPECT_THAT(format.error().what, HasSubstr("YUYV"));
  const auto size = open("width = 641\nheight = 17");
  ASSERT_FALSE(size);
  EXPECT_EQ(size.error().code, Errc::kInvalidOption);
  EXPECT_THAT(size.error().what, HasSubstr("nearest"));
  const auto gain = open("gain = 100000");
  ASSERT_FALSE(gain);
  EXPECT_EQ(gain.error().code, Errc::kInvalidOption);
  EXPECT_THAT(gain.error().what, HasSubstr("0 to 255"));
  const auto camera = open("");
  ASSERT_TRUE(camera) << camera.error().what;
  const auto exposure = (*camera)->set_exposure(0.01);
  ASSERT_FALSE(exposure);
  EXPECT_EQ(exposure.error().code, Errc::kUnavailable);
}

TEST(V4l2Lab, ChangesItsFormatAndKeepsItWhereAnotherIsRefused) {
  const auto camera = open("format = \"YUYV\"\nwidth = 640\nheight = 360");
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_EQ((*camera)->pixel_formats().front(), "YUYV");
  EXPECT_GT((*camera)->pixel_formats().size(), 3u);
  ASSERT_TRUE((*camera)->set_pixel_format("Y16"));
  EXPECT_EQ((*camera)->pixel_formats().front(), "Y16");
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame) << frame.error().what;
  EXPECT_EQ(frame->full_scale, 65535);
  EXPECT_EQ(frame->counts.height(), 360);
  const auto refused = (*camera)->set_pixel_format("ZZZZ");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  const auto after = (*camera)->grab();
  ASSERT_TRUE(after) << after.error().what;
  EXPECT_EQ(after->full_scale, 65535);
}

TEST(V4l2Lab, NamesWhoHoldsTheCamera) {
  std::array<int, 2> ready{};
  ASSERT_EQ(::pipe(ready.data()), 0);
  const pid_t other = ::fork();
  if (other == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that crashed
    const auto camera = open("");
    const char byte = camera ? 'y' : 'n';
    if (::write(ready[1], &byte, 1) != 1) ::_exit(1);
    for (;;) ::pause();
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  ASSERT_EQ(byte, 'y');
  const auto held = open("");
  const auto cameras = list_v4l2();
  ::kill(other, SIGKILL);
  ::waitpid(other, nullptr, 0);
  ASSERT_FALSE(held);
  EXPECT_EQ(held.error().code, Errc::kUnavailable);
  EXPECT_THAT(held.error().what, HasSubstr(fmt::format("process {}", other)));
  ASSERT_TRUE(cameras);
  ASSERT_EQ(cameras->size(), 1u);
  EXPECT_THAT(cameras->front().state, HasSubstr(fmt::format("process {}", other)));
  EXPECT_TRUE(open(""));  // free again
}

TEST(V4l2Lab, NamesTheGroupWhereThereIsNoPermission) {
  ASSERT_EQ(::seteuid(65534), 0);
  const auto camera = open("");
  ASSERT_EQ(::seteuid(0), 0);
  ASSERT_FALSE(camera);
  EXPECT_EQ(camera.error().code, Errc::kUnavailable);
  EXPECT_THAT(camera.error().what, HasSubstr("group video"));
}

// Last: there is no camera after it.
TEST(V4l2LabUnplugged, IsDisconnectedInTheMiddleAndNotThereAfterwards) {
  const auto camera = open("");
  ASSERT_TRUE(camera) << camera.error().what;
  ASSERT_TRUE((*camera)->grab());
  {
    std::ofstream unbind("/sys/bus/platform/drivers/vivid/unbind");
    unbind << "vivid.0" << std::flush;
    ASSERT_TRUE(unbind.good());
  }
  const Time before = SteadyClock().now();
  const auto lost = (*camera)->grab();
  EXPECT_LT(to_seconds(SteadyClock().now() - before), 15);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, Errc::kDisconnected) << lost.error().what;
  const auto again = open("");
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, Errc::kNotFound) << again.error().what;
}

}  // namespace
}  // namespace veneer::capture
