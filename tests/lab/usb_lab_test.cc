// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <functional>
#include <memory>
#include <thread>

#include "calibration/instruments/colorhug/colorhug.h"
#include "projector/control/dlpc350/dlpc350.h"
#include "tests/lab/usb_devices.h"
#include "tracking/drivers.h"
#include "tracking/testing/holdings.h"

// Drivers over the kernel's own USB stack: the real hidapi, hidraw, libusb, usbfs and udev, on
// devices that tests/lab/ plays. Runs as root in the kernel lab (./dev lab usb). Times are real and
// the machine is emulated, so that limits on them are loose.
namespace veneer {
namespace {

using namespace std::chrono_literals;
using lab::HidGadget;
using ::testing::HasSubstr;

/// udev has made what it makes of what was plugged in.
void settle() { EXPECT_EQ(std::system("udevadm settle --timeout=20"), 0); }

class UsbLab : public ::testing::Test {
 protected:
  template <class Usb>
  void plug(Usb& usb) {
    const Status plugged = usb.plug();
    ASSERT_TRUE(plugged) << plugged.error().what;
    settle();
  }
  SteadyClock clock_;
};

// --- the light engine

class LightEngineLab : public UsbLab {
 protected:
  std::unique_ptr<projector::Dlpc350> open() {
    auto opened = projector::Dlpc350::open(options_, clock_);
    EXPECT_TRUE(opened) << opened.error().what;
    return opened ? *std::move(opened) : nullptr;
  }
  projector::Dlpc350Options options_;
};

TEST_F(LightEngineLab, ItsWholeStateIsRead) {
  lab::LightEngine engine;
  plug(engine.usb());
  const auto control = open();
  ASSERT_TRUE(control);
  const auto state = control->read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->power, projector::Power::kOn);
  EXPECT_EQ(state->firmware, "4.4.0");
  EXPECT_EQ(state->serial, "LCR3");
  EXPECT_EQ(state->input, "parallel");
  EXPECT_EQ(state->muted, false);
  EXPECT_EQ(state->degamma, true);
  EXPECT_EQ(state->locked, true);
  EXPECT_EQ(state->led_levels, (projector::LedLevels{100, 120, 90}));
}

TEST_F(LightEngineLab, WhatItIsToldIsReadBack) {
  lab::LightEngine engine;
  plug(engine.usb());
  const auto control = open();
  ASSERT_TRUE(control);
  ASSERT_TRUE(control->mute(true));
  EXPECT_EQ(engine.value(0x1A07), 0);
  ASSERT_TRUE(control->freeze(true));
  ASSERT_TRUE(control->set_degamma(false));
  ASSERT_TRUE(control->set_led_levels({1, 254, 255}));
  const auto state = control->read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->muted, true);
  EXPECT_EQ(state->frozen, true);
  EXPECT_EQ(state->degamma, false);
  EXPECT_EQ(state->led_levels, (projector::LedLevels{1, 254, 255}));
  ASSERT_TRUE(control->mute(false));
  EXPECT_EQ(engine.value(0x1A07), 0x08);
}

TEST_F(LightEngineLab, OnlyTheInterfaceThatTakesCommandsGetsAny) {
  lab::LightEngine engine;
  plug(engine.usb());
  ASSERT_EQ(projector::connected_light_engines().size(), 1U) << "it has two nodes";
  const auto control = open();
  ASSERT_TRUE(control);
  EXPECT_TRUE(control->read_state());
  EXPECT_EQ(engine.strays(), 0);
}

TEST_F(LightEngineLab, ADeviceWithAnotherInterfaceInItsPlaceIsNotTaken) {
  lab::LightEngine engine("LCR3", HidGadget::Layout{1, true});
  plug(engine.usb());
  EXPECT_TRUE(projector::connected_light_engines().empty());
  const auto none = projector::Dlpc350::open(options_, clock_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kNotFound);
}

TEST_F(LightEngineLab, OfTwoTheSerialNumberDecides) {
  lab::LightEngine first("LCR3");
  lab::LightEngine second("LCR4");
  plug(first.usb());
  plug(second.usb());
  const auto either = projector::Dlpc350::open(options_, clock_);
  ASSERT_FALSE(either);
  EXPECT_EQ(either.error().code, Errc::kInvalidOption);
  EXPECT_THAT(either.error().what, HasSubstr("LCR4"));
  options_.serial = "LCR4";
  const auto control = open();
  ASSERT_TRUE(control);
  ASSERT_TRUE(control->mute(true));
  EXPECT_EQ(first.value(0x1A07), 0x08);
  EXPECT_EQ(second.value(0x1A07), 0);
}

TEST_F(LightEngineLab, OneThatIsPulledOutIsDisconnectedForGood) {
  lab::LightEngine engine;
  plug(engine.usb());
  const auto control = open();
  ASSERT_TRUE(control);
  ASSERT_TRUE(control->read_state());
  ASSERT_TRUE(engine.usb().unplug());
  for (int i = 0; i < 2; ++i) {
    const auto state = control->read_state();
    ASSERT_FALSE(state);
    EXPECT_EQ(state.error().code, Errc::kDisconnected) << state.error().what;
  }
  plug(engine.usb());
  EXPECT_EQ(control->freeze(true).error().code, Errc::kDisconnected);
  const auto again = open();
  ASSERT_TRUE(again);
  EXPECT_TRUE(again->freeze(true));
}

TEST_F(LightEngineLab, PulledOutWhileAnAnswerIsWaitedForEndsTheWait) {
  options_.time_limit = 30s;
  lab::LightEngine engine;
  plug(engine.usb());
  const auto control = open();
  ASSERT_TRUE(control);
  engine.be_silent(true);
  std::thread puller([&] {
    std::this_thread::sleep_for(300ms);
    EXPECT_TRUE(engine.usb().unplug());
  });
  const Time begin = clock_.now();
  const auto state = control->read_state();
  puller.join();
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().code, Errc::kDisconnected) << state.error().what;
  EXPECT_LT(clock_.now() - begin, 15s);
}

TEST_F(LightEngineLab, SilenceEndsInTimeAndTheNextCommandWorks) {
  options_.time_limit = 500ms;
  lab::LightEngine engine;
  plug(engine.usb());
  const auto control = open();
  ASSERT_TRUE(control);
  engine.be_silent(true);
  const Status lost = control->freeze(true);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, Errc::kTimeout);
  engine.be_silent(false);
  EXPECT_TRUE(control->freeze(true));
}

// --- the colorimeter

class ColorHugLab : public UsbLab {
 protected:
  std::unique_ptr<calibration::ColorHug> open() {
    auto opened = calibration::ColorHug::open({}, clock_);
    EXPECT_TRUE(opened) << opened.error().what;
    return opened ? *std::move(opened) : nullptr;
  }
  Result<Xyz> read(calibration::ColorHug& instrument) {
    return instrument.read(calibration::Target::kWhiteReference, Eigen::Vector2d::Zero());
  }
  lab::ColorHug2 device_;
};

TEST_F(ColorHugLab, EveryReadingIsWhatTheDeviceSaid) {
  plug(device_.usb());
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  EXPECT_THAT(instrument->description(), HasSubstr("serial number 12345, firmware 2.0.7"));
  constexpr double kOne = 65536;
  const Xyz said(lab::ColorHug2::kX / kOne, lab::ColorHug2::kY / kOne, lab::ColorHug2::kZ / kOne);
  for (int i = 0; i < 20; ++i) {
    const auto xyz = read(*instrument);
    ASSERT_TRUE(xyz) << xyz.error().what;
    EXPECT_EQ(*xyz, said);
  }
}

TEST_F(ColorHugLab, PulledOutInTheMiddleOfAReadingIsFinalAndItCanBeOpenedAgain) {
  plug(device_.usb());
  {
    const auto instrument = open();
    ASSERT_TRUE(instrument);
    device_.be_busy(true);
    std::thread puller([&] {
      std::this_thread::sleep_for(300ms);
      EXPECT_TRUE(device_.usb().unplug());
    });
    const Time begin = clock_.now();
    const auto xyz = read(*instrument);
    puller.join();
    ASSERT_FALSE(xyz);
    EXPECT_EQ(xyz.error().code, Errc::kDisconnected) << xyz.error().what;
    EXPECT_LT(clock_.now() - begin, 9s) << "not the time limit, which is ten";
    EXPECT_EQ(read(*instrument).error().code, Errc::kDisconnected);
  }
  device_.be_busy(false);
  plug(device_.usb());
  const auto instrument = open();
  ASSERT_TRUE(instrument);
  EXPECT_TRUE(read(*instrument));
}

// --- the tracker

class LibertyLab : public UsbLab {
 protected:
  void SetUp() override {
    auto toml = TomlReader::parse("driver = \"polhemus\"", "test");
    ASSERT_TRUE(toml);
    auto tracker = tracking::open_tracker(*toml, clock_);
    ASSERT_TRUE(tracker) << tracker.error().what;
    tracker_ = *std::move(tracker);
  }
  // Ours before the bus's: the tracker has the device open.
  void TearDown() override { tracker_.reset(); }
  bool run_until(const std::function<bool()>& done, Duration patience = 20s) {
    const Time give_up = clock_.now() + patience;
    while (!done() && clock_.now() < give_up) {
      const auto sample = tracker_->wait_pose(20ms);
      if (!sample) continue;
      newest_ = *sample;
      ++samples_;
    }
    return done();
  }
  bool becomes(tracking::TrackerState state) {
    return run_until([&] { return tracker_->status().state == state; });
  }
  bool tracks() {
    const int before = samples_;
    return run_until([&] { return samples_ >= before + 20; });
  }
  void plug_in() {
    const Status plugged = device_.usb().plug();
    ASSERT_TRUE(plugged) << plugged.error().what;
  }

  lab::Liberty device_;
  std::unique_ptr<tracking::Tracker> tracker_;
  tracking::PoseSample newest_;
  int samples_ = 0;
};

TEST_F(LibertyLab, ItsPosesArriveInMetres) {
  ASSERT_TRUE(becomes(tracking::TrackerState::kAbsent));
  plug_in();
  ASSERT_TRUE(tracks()) << tracker_->status().detail;
  const Eigen::Vector3d sent(lab::Liberty::kX_cm, lab::Liberty::kY_cm, lab::Liberty::kZ_cm);
  EXPECT_NEAR((newest_.world_from_body.translation - sent / 100).norm(), 0, 1e-6);
  EXPECT_TRUE(becomes(tracking::TrackerState::kTracking)) << tracker_->status().detail;
  EXPECT_EQ(device_.starts(), 1);
}

TEST_F(LibertyLab, UnplugIsToldAndReplugTakesItUpAgainAndNothingLeaks) {
  plug_in();
  ASSERT_TRUE(tracks()) << tracker_->status().detail;
  const std::size_t descriptors = tracking::count_descriptors();
  for (int i = 2; i < 6; ++i) {
    ASSERT_TRUE(device_.unplug());
    ASSERT_TRUE(becomes(tracking::TrackerState::kAbsent)) << tracker_->status().detail;
    plug_in();
    ASSERT_TRUE(tracks()) << tracker_->status().detail;
    EXPECT_EQ(device_.starts(), i) << "told again what to send, once";
  }
  EXPECT_EQ(tracking::count_descriptors(), descriptors);
}

TEST_F(LibertyLab, UnplugAtAnyMomentOfTheStartIsSurvived) {
  for (int step = 0; step < 6; ++step) {
    plug_in();
    const Time pull = clock_.now() + 60ms * step;
    run_until([&] { return clock_.now() >= pull; });
    ASSERT_TRUE(device_.unplug());
    ASSERT_TRUE(becomes(tracking::TrackerState::kAbsent)) << tracker_->status().detail;
  }
  plug_in();
  EXPECT_TRUE(tracks()) << tracker_->status().detail;
}

}  // namespace
}  // namespace veneer
