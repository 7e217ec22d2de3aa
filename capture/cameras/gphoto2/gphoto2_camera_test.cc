// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/gphoto2/gphoto2_camera.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "base/testing/temporary_folder.h"
#include "capture/testing/dng.h"
#include "capture/testing/ptpip_camera.h"

// The genuine libgphoto2 and its driver for PTP cameras talk to a camera on the loopback.
namespace veneer::capture {
namespace {

using ::testing::HasSubstr;
using testing::PtpFault;
using testing::PtpipCamera;
using testing::PtpObject;

constexpr std::uint16_t kWhite = 16383;

/// What the sensor sees: as many counts as the camera's time counts, times its place.
Image<std::uint16_t> sensor(std::uint32_t exposure) {
  Image<std::uint16_t> mosaic(64, 48);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      mosaic(x, y) = static_cast<std::uint16_t>(
          std::min<std::uint32_t>(kWhite, exposure * static_cast<std::uint32_t>(1 + x + y) / 8));
    }
  }
  return mosaic;
}

std::vector<PtpObject> raw_only(std::uint32_t exposure, std::uint16_t) {
  return {{"DSC_0001.NEF", testing::bayer_dng(sensor(exposure), kWhite)}};
}

class Gphoto2Test : public ::testing::Test {
 protected:
  // libgphoto2 keeps its settings in the home folder.
  void SetUp() override { ::setenv("HOME", home_.path().c_str(), 1); }

  static Result<std::unique_ptr<Camera>> open(const std::string& text) {
    VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "test"));
    VENEER_ASSIGN(auto camera, open_gphoto2(toml));
    VENEER_TRY(toml.finish());
    return camera;
  }
  static Result<std::unique_ptr<Camera>> open(const PtpipCamera& camera,
                                              const std::string& more = "") {
    return open(fmt::format("port = \"{}\"\nanswer_s = 10\n{}", camera.port(), more));
  }

  TemporaryFolder home_;
};

TEST_F(Gphoto2Test, GivesTheSensorsCountsExactly) {
  const PtpipCamera device(raw_only);
  const auto camera = open(device);
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_THAT((*camera)->description(), HasSubstr("0815"));
  EXPECT_EQ((*camera)->width(), 64);
  EXPECT_EQ((*camera)->height(), 48);
  const Time before = SteadyClock().now();
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame) << frame.error().what;
  EXPECT_EQ(frame->full_scale, kWhite);
  EXPECT_DOUBLE_EQ(frame->exposure_s, 0.008);
  const Duration half = from_seconds(0.5 * frame->exposure_s);
  EXPECT_GE(frame->time, before + half);
  EXPECT_LE(frame->time, SteadyClock().now() + half);
  const auto truth = sensor(80);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      ASSERT_EQ(frame->counts(x, y)[static_cast<std::size_t>(x % 2 + y % 2)], truth(x, y));
    }
  }
}

TEST_F(Gphoto2Test, LightIsProportionalToTheExposureItClaims) {
  const PtpipCamera device(raw_only);
  const auto camera = open(device);
  ASSERT_TRUE(camera) << camera.error().what;
  ASSERT_TRUE((*camera)->set_exposure(0.0011));
  const auto shorter = (*camera)->grab();
  ASSERT_TRUE(shorter) << shorter.error().what;
  ASSERT_TRUE((*camera)->set_exposure(0.1));
  const auto longer = (*camera)->grab();
  ASSERT_TRUE(longer) << longer.error().what;
  EXPECT_DOUBLE_EQ(shorter->exposure_s, 0.001);
  EXPECT_DOUBLE_EQ(longer->exposure_s, 0.125);
  EXPECT_EQ(shorter->counts(7, 0)[1] * 125, longer->counts(7, 0)[1]);
}

TEST_F(Gphoto2Test, NamesItsRangeOfExposures) {
  const PtpipCamera device(raw_only);
  const auto camera = open(device);
  ASSERT_TRUE(camera) << camera.error().what;
  EXPECT_DOUBLE_EQ((*camera)->exposure_range().least_s, 0.0001);
  EXPECT_DOUBLE_EQ((*camera)->exposure_range().most_s, 1);
  for (const double seconds : {0.00005, 2.0, 0.0, std::nan("")}) {
    const auto set = (*camera)->set_exposure(seconds);
    ASSERT_FALSE(set) << seconds;
    EXPECT_EQ(set.error().code, Errc::kInvalidOption);
    EXPECT_THAT(set.error().what, HasSubstr("0.0001 to 1 s"));
  }
}

TEST_F(Gphoto2Test, LeavesStandardInputOpen) {
  const int before = ::fcntl(0, F_GETFD);
  const PtpipCamera device(raw_only);
  ASSERT_TRUE(open(device));
  EXPECT_EQ(::fcntl(0, F_GETFD), before);
}

TEST_F(Gphoto2Test, FixesTheSensitivity) {
  const PtpipCamera device(raw_only);
  ASSERT_TRUE(open(device, "iso = 400"));
  EXPECT_EQ(device.iso(), 400);
  const auto unknown = open(device, "iso = 123");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, Errc::kInvalidOption);
  EXPECT_THAT(unknown.error().what, HasSubstr("100, 200, 400"));
}

TEST_F(Gphoto2Test, SaysWhichSettingsTheCameraLacks) {
  const PtpipCamera device(raw_only);
  const auto camera = open(device, "white_balance = \"Daylight\"");
  ASSERT_FALSE(camera);
  EXPECT_EQ(camera.error().code, Errc::kUnavailable);
  EXPECT_THAT(camera.error().what, HasSubstr("whitebalance"));
}

TEST_F(Gphoto2Test, TakesTheRawOfAPairInEitherOrderAndLeavesNothingOnTheCard) {
  for (const bool raw_first : {false, true}) {
    for (const std::string more : {"", "allow_encoded = true"}) {
      const PtpipCamera device([&](std::uint32_t exposure, std::uint16_t) {
        std::vector<PtpObject> pair{{"DSC_0001.JPG", testing::grey_jpeg(16, 16, 200)},
                                    raw_only(exposure, 100).front()};
        if (raw_first) std::swap(pair[0], pair[1]);
        return pair;
      });
      const auto camera = open(device, more);
      ASSERT_TRUE(camera) << camera.error().what;
      for (int i = 0; i < 3; ++i) {
        const auto frame = (*camera)->grab();
        ASSERT_TRUE(frame) << frame.error().what;
        EXPECT_EQ(frame->counts.width(), 64);
        EXPECT_EQ(frame->full_scale, kWhite);
      }
      EXPECT_EQ(device.files(), 0);
    }
  }
}

TEST_F(Gphoto2Test, TakesEncodedPicturesOnlyWhereThatIsAskedFor) {
  const PtpipCamera device([](std::uint32_t, std::uint16_t) {
    return std::vector<PtpObject>{{"DSC_0001.JPG", testing::grey_jpeg(32, 16, 200)}};
  });
  const auto refused = open(device);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
  EXPECT_THAT(refused.error().what, HasSubstr("allow_encoded"));
  const auto camera = open(device, "allow_encoded = true");
  ASSERT_TRUE(camera) << camera.error().what;
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame) << frame.error().what;
  EXPECT_EQ(frame->full_scale, 255);
  EXPECT_EQ(frame->counts.width(), 32);
  // A flat block is its mean alone, which libjpeg's standard quality keeps within a code.
  EXPECT_NEAR(frame->counts(5, 5)[1], 200, 1);
}

TEST_F(Gphoto2Test, WaitsForABusyCameraAndNotForever) {
  PtpipCamera device(raw_only);
  const auto camera = open(device);
  ASSERT_TRUE(camera) << camera.error().what;
  device.misbehave(PtpFault::kBusy, 2);
  const int before = device.captures();
  const auto frame = (*camera)->grab();
  ASSERT_TRUE(frame) << frame.error().what;
  EXPECT_EQ(device.captures() - before, 3);

  device.misbehave(PtpFault::kBusy, 100);
  const auto busy = (*camera)->grab();
  ASSERT_FALSE(busy);
  EXPECT_EQ(busy.error().code, Errc::kTimeout);
  EXPECT_THAT(busy.error().what, HasSubstr("busy"));
}

TEST_F(Gphoto2Test, NamesFocusAndLightWhereTheCameraRefuses) {
  PtpipCamera device(raw_only);
  const auto camera = open(device);
  ASSERT_TRUE(camera) << camera.error().what;
  device.misbehave(PtpFault::kRefused);
  const auto refused = (*camera)->grab();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kIo);
  EXPECT_THAT(refused.error().what, HasSubstr("manual focus"));
  EXPECT_TRUE((*camera)->grab());
}

TEST_F(Gphoto2Test, SaysThatNoPictureCame) {
  PtpipCamera device(raw_only);
  const auto camera = open(device);
  ASSERT_TRUE(camera) << camera.error().what;
  device.misbehave(PtpFault::kNoPicture);
  const auto none = (*camera)->grab();
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kTimeout) << none.error().what;
  EXPECT_TRUE((*camera)->grab());
}

TEST_F(Gphoto2Test, IsDisconnectedOnceTheConnectionEndsAndOpensAgain) {
  PtpipCamera device(raw_only);
  {
    const auto camera = open(device);
    ASSERT_TRUE(camera) << camera.error().what;
    device.misbehave(PtpFault::kCloseInData);
    for (int i = 0; i < 2; ++i) {
      const auto lost = (*camera)->grab();
      ASSERT_FALSE(lost);
      EXPECT_EQ(lost.error().code, Errc::kDisconnected) << lost.error().what;
    }
    const auto set = (*camera)->set_exposure(0.008);
    ASSERT_FALSE(set);
    EXPECT_EQ(set.error().code, Errc::kDisconnected);
  }
  const auto again = open(device);
  ASSERT_TRUE(again) << again.error().what;
  EXPECT_TRUE((*again)->grab());
}

TEST_F(Gphoto2Test, RefusesTimesThatAreNone) {
  for (const char* answer : {"-1", "0", "1e9"}) {
    const auto camera = open(fmt::format("port = \"ptpip:127.0.0.1:1:1\"\nanswer_s = {}", answer));
    ASSERT_FALSE(camera) << answer;
    EXPECT_EQ(camera.error().code, Errc::kInvalidOption) << camera.error().what;
    EXPECT_THAT(camera.error().what, HasSubstr("answer_s"));
  }
}

TEST_F(Gphoto2Test, GivesUpOnACameraThatHangs) {
  PtpipCamera device(raw_only);
  const auto camera = open(fmt::format("port = \"{}\"\nanswer_s = 1.5", device.port()));
  ASSERT_TRUE(camera) << camera.error().what;
  device.misbehave(PtpFault::kHang);
  const Time before = SteadyClock().now();
  const auto hung = (*camera)->grab();
  const double waited_s = to_seconds(SteadyClock().now() - before);
  ASSERT_FALSE(hung);
  EXPECT_EQ(hung.error().code, Errc::kDisconnected) << hung.error().what;
  EXPECT_THAT(hung.error().what, HasSubstr("hangs"));
  EXPECT_GE(waited_s, 1.5);
  EXPECT_LT(waited_s, 5);  // a second thread's start on a busy machine
}

TEST_F(Gphoto2Test, RefusesADamagedPictureAndTakesTheNext) {
  bool damaged = false;
  const PtpipCamera device([&](std::uint32_t exposure, std::uint16_t iso) {
    auto files = raw_only(exposure, iso);
    if (damaged) files[0].bytes.resize(files[0].bytes.size() / 2);
    return files;
  });
  const auto camera = open(device);
  ASSERT_TRUE(camera) << camera.error().what;
  damaged = true;
  const auto bad = (*camera)->grab();
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().code, Errc::kBadFormat) << bad.error().what;
  damaged = false;
  EXPECT_TRUE((*camera)->grab());
}

TEST_F(Gphoto2Test, RefusesWhatIsNotThere) {
  const auto model = open("model = \"No Such Camera 3000\"");
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, Errc::kNotFound) << model.error().what;
  const auto unknown = open("model = \"No Such Camera 3000\"\nport = \"ptpip:127.0.0.1:1:1\"");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, Errc::kNotFound) << unknown.error().what;
  const auto silent = open("port = \"ptpip:127.0.0.1:1:1\"");  // nobody listens there
  ASSERT_FALSE(silent);
  EXPECT_EQ(silent.error().code, Errc::kUnavailable) << silent.error().what;
  EXPECT_THAT(silent.error().what, HasSubstr("is it on"));
}

TEST_F(Gphoto2Test, ListsWithoutOpening) {
  const auto cameras = list_gphoto2();
  ASSERT_TRUE(cameras) << cameras.error().what;
  for (const CameraInfo& camera : *cameras) EXPECT_EQ(camera.driver, "gphoto2");
}

}  // namespace
}  // namespace veneer::capture
