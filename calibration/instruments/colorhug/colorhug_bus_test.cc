// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "calibration/instruments/colorhug/colorhug.h"
#include "calibration/instruments/instruments.h"
#include "tracking/testing/mock_hidraw.h"

// The real hidapi on a mocked bus. Times here are real, so that limits on them are loose.
namespace veneer::calibration {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;
using tracking::mock::Bytes;
using tracking::mock::HidrawDevice;

Bytes report(std::initializer_list<int> values, std::size_t size = colorhug::kReportSize) {
  Bytes bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  bytes.resize(size);
  return bytes;
}

/// What hidapi is to have written: the report's number, 0, and 64 bytes.
Bytes written(std::initializer_list<int> values) {
  Bytes bytes = report(values);
  bytes.insert(bytes.begin(), std::byte{0});
  return bytes;
}

const Bytes kVersionReply = report({0x00, 0x07, 2, 0, 0, 0, 7, 0});
const Bytes kSerialReply = report({0x00, 0x0B, 0x39, 0x30, 0, 0});  // 12345
const Bytes kReadingReply =
    report({0x00, 0x23, 0x00, 0x80, 0x23, 0x00, 0x00, 0x00, 0x28, 0x00, 0x00, 0x40, 0x10, 0x00});
const Xyz kReading(35.5, 40.0, 16.25);

/// A ColorHug2 that answers by a script.
class ColorHugBus : public ::testing::Test {
 protected:
  explicit ColorHugBus(std::uint16_t product = 0x1004)
      : device_({0x273f, product, "ColorHug2", "", "2-1", 0}) {
    device_.on_output([this](const Bytes& bytes) {
      std::function<void()> answer;
      {
        const std::lock_guard lock(mutex_);
        received_.push_back(bytes);
        const int command = bytes.size() > 1 ? std::to_integer<int>(bytes[1]) : -1;
        if (command == 0x07) answer = [this] { device_.send(kVersionReply); };
        if (command == 0x0B) answer = [this] { device_.send(kSerialReply); };
        if (command == 0x23) answer = on_reading_;
      }
      if (answer) answer();
    });
  }

  std::unique_ptr<ColorHug> open() {
    auto opened = ColorHug::open(options_, clock_);
    EXPECT_TRUE(opened) << opened.error().what;
    return opened ? *std::move(opened) : nullptr;
  }
  Result<Xyz> read(ColorHug& instrument) {
    return instrument.read(Target::kWhiteReference, Eigen::Vector2d::Zero());
  }
  void reply_to_readings(std::function<void()> answer) {
    const std::lock_guard lock(mutex_);
    on_reading_ = std::move(answer);
  }
  std::vector<Bytes> received() {
    const std::lock_guard lock(mutex_);
    return received_;
  }

  SteadyClock clock_;
  ColorHugOptions options_;
  std::mutex mutex_;
  std::vector<Bytes> received_;
  std::function<void()> on_reading_ = [this] { device_.send(kReadingReply); };
  HidrawDevice device_;
};

TEST_F(ColorHugBus, EveryByteThatItReceivesIsAsLaidDown) {
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  EXPECT_THAT(instrument->description(), HasSubstr("serial number 12345, firmware 2.0.7"));
  const auto xyz = read(*instrument);
  ASSERT_TRUE(xyz) << xyz.error().what;
  EXPECT_EQ(*xyz, kReading);
  EXPECT_EQ(received(),
            (std::vector<Bytes>{written({0x07}), written({0x0B}), written({0x23, 0x42, 0x00})}));
}

TEST_F(ColorHugBus, AnIncompleteRequestIsReadAgainAndNotSentAgain) {
  reply_to_readings([this] {
    for (int i = 0; i < 3; ++i) device_.send(report({0x12, 0x23}));
    device_.send(kReadingReply);
  });
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_TRUE(xyz) << xyz.error().what;
  EXPECT_EQ(*xyz, kReading);
  EXPECT_EQ(received().size(), 3U);
}

TEST_F(ColorHugBus, OneThatIsNeverDoneIsGivenUp) {
  reply_to_readings([this] {
    for (int i = 0; i < 100; ++i) device_.send(report({0x12, 0x23}));
  });
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_FALSE(xyz);
  EXPECT_EQ(xyz.error().code, Errc::kTimeout);
}

TEST_F(ColorHugBus, AReadingThatComesTooLateIsNotTakenForTheNext) {
  options_.time_limit = milliseconds(200);
  reply_to_readings({});
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  const auto nothing = read(*instrument);
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, Errc::kTimeout);
  device_.send(report({0x00, 0x23, 1, 2, 3, 4}));  // the answer, too late
  reply_to_readings([this] { device_.send(kReadingReply); });
  const auto xyz = read(*instrument);
  ASSERT_TRUE(xyz) << xyz.error().what;
  EXPECT_EQ(*xyz, kReading);
}

TEST_F(ColorHugBus, WhatItComplainsOfIsPassedOnAndTheNextReadingWorks) {
  reply_to_readings([this] { device_.send(report({0x0C, 0x23})); });
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  const auto none = read(*instrument);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kBadFormat);
  EXPECT_THAT(none.error().what, HasSubstr("no calibration"));
  reply_to_readings([this] { device_.send(report({0x0F, 0x23})); });
  EXPECT_THAT(read(*instrument).error().what, HasSubstr("too much light"));
  reply_to_readings([this] { device_.send(kReadingReply); });
  EXPECT_TRUE(read(*instrument));
}

TEST_F(ColorHugBus, AShortReplyIsRefused) {
  reply_to_readings([this] { device_.send(report({0x00, 0x23, 1, 2}, 10)); });
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_FALSE(xyz);
  EXPECT_EQ(xyz.error().code, Errc::kBadFormat);
  EXPECT_THAT(xyz.error().what, HasSubstr("10 bytes"));
}

TEST_F(ColorHugBus, UnpluggedInTheMiddleOfAReadingIsFinal) {
  reply_to_readings([this] { device_.send(report({0x12, 0x23})); });
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  std::thread puller([this] {
    std::this_thread::sleep_for(milliseconds(100));
    device_.unplug();
  });
  const Time begin = clock_.now();
  const auto xyz = read(*instrument);
  puller.join();
  ASSERT_FALSE(xyz);
  EXPECT_EQ(xyz.error().code, Errc::kDisconnected);
  EXPECT_THAT(xyz.error().what, HasSubstr("unplugged"));
  EXPECT_LT(clock_.now() - begin, seconds(5));  // not the time limit, which is ten
  EXPECT_EQ(read(*instrument).error().code, Errc::kDisconnected);
}

TEST_F(ColorHugBus, UnpluggedBetweenReadingsIsFinalAndItCanBeOpenedAgain) {
  device_.plug();
  {
    const auto instrument = open();
    ASSERT_TRUE(instrument);
    device_.unplug();
    EXPECT_EQ(read(*instrument).error().code, Errc::kDisconnected);
  }
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  EXPECT_TRUE(read(*instrument));
}

TEST_F(ColorHugBus, TheCalibrationIsSentAndTheCorrectionIsApplied) {
  options_.calibration = 3;
  options_.corrected_from_read << 2, 0, 0, 0, 1, 0, 1, 0, 1;
  device_.plug();
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  const auto xyz = read(*instrument);
  ASSERT_TRUE(xyz);
  EXPECT_EQ(*xyz, Xyz(71, 40, 51.75));
  EXPECT_EQ(received().back(), written({0x23, 0x03, 0x00}));
}

TEST_F(ColorHugBus, OneThatIsNotThereIsSaidSo) {
  const auto opened = ColorHug::open(options_, clock_);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, Errc::kNotFound);
  EXPECT_THAT(opened.error().what, HasSubstr("plugged in"));
}

TEST_F(ColorHugBus, OneThatSaysNothingIsATimeOut) {
  options_.time_limit = milliseconds(100);
  device_.on_output({});
  device_.plug();
  const auto opened = ColorHug::open(options_, clock_);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, Errc::kTimeout);
}

TEST_F(ColorHugBus, OptionsOutOfRangeAreRefused) {
  const auto refused = [&](auto change) {
    ColorHugOptions options;
    change(options);
    const Status status = options.check();
    return !status && status.error().code == Errc::kInvalidOption;
  };
  EXPECT_TRUE(refused([](ColorHugOptions& o) { o.calibration = 68; }));
  EXPECT_TRUE(refused([](ColorHugOptions& o) { o.calibration = -1; }));
  EXPECT_TRUE(refused([](ColorHugOptions& o) { o.corrected_from_read(1, 1) = NAN; }));
  EXPECT_TRUE(refused([](ColorHugOptions& o) { o.time_limit = {}; }));
}

TEST_F(ColorHugBus, ItIsListedWithItsDriver) {
  device_.plug();
  const auto found = connected_instruments();
  ASSERT_TRUE(found) << found.error().what;
  ASSERT_EQ(found->size(), 1U);
  EXPECT_EQ(found->front().usb_id, "273f:1004");
  EXPECT_EQ(found->front().driver, "colorhug");
  EXPECT_EQ(found->front().usb_port, "2-1");
  EXPECT_EQ(found->front().remedy, "");
}

TEST_F(ColorHugBus, WithoutPermissionTheUdevRuleIsNamed) {
  device_.plug();
  if (::geteuid() == 0) GTEST_SKIP() << "root may open everything";
  std::filesystem::permissions(tracking::mock::Bus::instance().root() + device_.node(),
                               std::filesystem::perms::none);
  const auto opened = ColorHug::open(options_, clock_);
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error().what, HasSubstr("60-veneer-instruments.rules"));
}

class ColorHugBootLoader : public ColorHugBus {
 protected:
  ColorHugBootLoader() : ColorHugBus(0x1005) {}
};

TEST_F(ColorHugBootLoader, IsToldFromOneThatIsNotThere) {
  device_.plug();
  const auto opened = ColorHug::open(options_, clock_);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, Errc::kUnavailable);
  EXPECT_THAT(opened.error().what, HasSubstr("boot loader (273f:1005)"));
  EXPECT_EQ(device_.openings(), 0U);
  const auto found = connected_instruments();
  ASSERT_TRUE(found);
  ASSERT_EQ(found->size(), 1U);
  EXPECT_EQ(found->front().driver, "");
  EXPECT_THAT(found->front().remedy, HasSubstr("boot loader"));
}

class ColorHugOfTheFirstGeneration : public ColorHugBus {
 protected:
  ColorHugOfTheFirstGeneration() : ColorHugBus(0x1001) {}
};

TEST_F(ColorHugOfTheFirstGeneration, IsLeftToSpotread) {
  device_.plug();
  const auto opened = ColorHug::open(options_, clock_);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, Errc::kUnavailable);
  EXPECT_THAT(opened.error().what, HasSubstr("spotread"));
}

}  // namespace
}  // namespace veneer::calibration
