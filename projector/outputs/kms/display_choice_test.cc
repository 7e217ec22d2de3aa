// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/display_choice.h"

#include <gtest/gtest.h>

#include "base/exit_code.h"
#include "projector/outputs/kms/fake_kms_device.h"

namespace veneer::projector {
namespace {

class DisplayChoiceTest : public testing::Test {
 protected:
  DisplayChoiceTest() {
    const std::vector<KmsMode> modes{fake_mode(1280, 800, 60),
                                     fake_mode(1920, 1080, 60),
                                     fake_mode(1920, 1080, 59.94, true),
                                     fake_mode(1920, 1080, 120)};
    card_.connectors = {{"HDMI-A-1", fake_edid("EPSON PJ", "A1"), true, modes},
                        {"DP-1", fake_edid("DELL", "B2"), true, modes},
                        {"DP-2", "", false, {}}};
  }
  Result<DisplayChoice> choose(const std::string& connector, const std::string& mode = "") {
    VirtualClock clock;
    FakeKmsDevice device(card_, clock);
    return choose_display(device, connector, mode);
  }
  FakeCard card_;
};

TEST_F(DisplayChoiceTest, IsBySocketNameOrSerial) {
  for (const char* name : {"HDMI-A-1", "EPSON PJ", "A1"}) {
    const auto choice = choose(name);
    ASSERT_TRUE(choice) << choice.error().what;
    EXPECT_EQ(choice->connector.id, FakeKmsDevice::connector_id(0)) << name;
  }
  EXPECT_EQ(choose("B2")->connector.name, "DP-1");
}

TEST_F(DisplayChoiceTest, NoNameIsEnoughWhereOneDisplayIsConnected) {
  card_.connectors[0].connected = false;
  const auto choice = choose("");
  ASSERT_TRUE(choice) << choice.error().what;
  EXPECT_EQ(choice->connector.name, "DP-1");
}

TEST_F(DisplayChoiceTest, ListsAllThatThereAreWhereItIsNotClear) {
  card_.connectors[2] = {"DP-2", fake_edid("LG", "C3"), true, {fake_mode(800, 600, 60)}};
  for (const char* name : {"", "DP-9", "SONY"}) {
    const auto choice = choose(name);
    ASSERT_FALSE(choice) << name;
    EXPECT_EQ(choice.error().code, Errc::kInvalidOption);
    for (const char* part :
         {"HDMI-A-1", "EPSON PJ", "A1", "DP-1", "DELL", "DP-2", "1280x800@60.00"})
      EXPECT_NE(choice.error().what.find(part), std::string::npos)
          << part << " is not in: " << choice.error().what;
  }
}

TEST_F(DisplayChoiceTest, TwoAlikeAreToldApartBySocket) {
  card_.connectors[1].edid = card_.connectors[0].edid;
  EXPECT_EQ(choose("EPSON PJ").error().code, Errc::kInvalidOption);
  EXPECT_TRUE(choose("DP-1"));
}

TEST_F(DisplayChoiceTest, WhatIsUnpluggedIsUnavailable) {
  const auto empty_socket = choose("DP-2");
  ASSERT_FALSE(empty_socket);
  EXPECT_EQ(empty_socket.error().code, Errc::kUnavailable);
  for (FakeConnector& each : card_.connectors) each.connected = false;
  const auto none = choose("");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kUnavailable);
  EXPECT_NE(none.error().what.find("cable"), std::string::npos);
  card_.connectors.clear();
  EXPECT_FALSE(choose(""));
  EXPECT_FALSE(choose("DP-1"));
}

// What systemd makes of it: a status of 2 ends the service for good, any other starts it anew.
TEST_F(DisplayChoiceTest, ANameThatMayBeThatOfAProjectorThatIsOffIsTriedAgain) {
  const FakeConnector on = card_.connectors[0];
  const FakeConnector dark{"HDMI-A-1", "", false, {}};
  const FakeConnector asleep{"HDMI-A-1", "", true, {fake_mode(1024, 768, 60)}};
  card_.connectors.pop_back();
  for (const FakeConnector& off : {dark, asleep}) {
    card_.connectors[0] = off;
    for (const char* name : {"EPSON PJ", "A1"}) {
      const auto choice = choose(name);
      ASSERT_FALSE(choice);
      EXPECT_EQ(exit_code_of(choice.error()), kExitFailed) << choice.error().what;
      for (const char* part : {"cable", "name is wrong", name, "HDMI-A-1", "DELL"})
        EXPECT_NE(choice.error().what.find(part), std::string::npos)
            << part << " is not in: " << choice.error().what;
    }
  }
  card_.connectors[0] = on;
  EXPECT_TRUE(choose("EPSON PJ"));
  EXPECT_EQ(exit_code_of(choose("EPSON PK").error()), kExitUsage);
}

TEST_F(DisplayChoiceTest, AModeThatADisplayMayNotHaveToldYetIsTriedAgain) {
  card_.connectors[0].edid.clear();
  for (const auto& made_up : std::vector<std::vector<KmsMode>>{{}, {fake_mode(1024, 768, 60)}}) {
    card_.connectors[0].modes = made_up;
    const auto choice = choose("HDMI-A-1", "1920x1080");
    ASSERT_FALSE(choice);
    EXPECT_EQ(exit_code_of(choice.error()), kExitFailed) << choice.error().what;
    EXPECT_NE(choice.error().what.find("cable"), std::string::npos) << choice.error().what;
  }
  card_.connectors[0].edid = fake_edid("EPSON PJ", "A1");
  EXPECT_EQ(exit_code_of(choose("HDMI-A-1", "1920x1080").error()), kExitUsage);
}

TEST_F(DisplayChoiceTest, TheModeIsTheNearestRateOfThatSize) {
  const auto rate = [this](const std::string& mode) {
    const auto choice = choose("DP-1", mode);
    return choice ? choice->mode.refresh_hz : 0;
  };
  EXPECT_EQ(rate(""), 59.94);
  EXPECT_EQ(rate("1920x1080"), 59.94);
  EXPECT_EQ(rate("1920x1080@60"), 60);
  EXPECT_EQ(rate("1920x1080@59.9"), 59.94);
  EXPECT_EQ(rate("1920x1080@120.4"), 120);
  EXPECT_EQ(rate("1280x800"), 60);
  EXPECT_EQ(rate("1920x1080@75"), 0);
}

TEST_F(DisplayChoiceTest, ModesThatAreNotUnderstoodOrNotThereAreRefused) {
  for (const char* mode : {"1920",
                           "1920x",
                           "x1080",
                           "1920x1080@",
                           "1920x1080i",
                           "-1920x1080",
                           "1920x1080@0",
                           "1920x1080@60Hz",
                           "640x480",
                           "1920x1080@1e",
                           "1920x1080@-60",
                           "1920x1080@nan",
                           "0x0",
                           "1920x1080@inf",
                           "99999999999x1",
                           " 1920x1080"}) {
    const auto choice = choose("DP-1", mode);
    ASSERT_FALSE(choice) << mode;
    EXPECT_EQ(choice.error().code, Errc::kInvalidOption) << mode;
  }
  EXPECT_NE(choose("DP-1", "640x480").error().what.find("1280x800@60.00"), std::string::npos);
}

TEST_F(DisplayChoiceTest, ModesWithoutAPeriodOrInHalvesAreLeftOut) {
  KmsMode halves = fake_mode(720, 576, 50);
  halves.interlaced = true;
  card_.connectors[1].modes = {halves, fake_mode(800, 600, 0), fake_mode(640, 480, 60)};
  EXPECT_EQ(choose("DP-1")->mode.width, 640);
  EXPECT_FALSE(choose("DP-1", "720x576"));
  EXPECT_FALSE(choose("DP-1", "800x600"));
  card_.connectors[1].modes = {};
  const auto none = choose("DP-1");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kUnavailable);
}

TEST_F(DisplayChoiceTest, NoOtherDisplayLosesItsEngine) {
  VirtualClock clock;
  FakeKmsDevice device(card_, clock);
  device.set_value(FakeKmsDevice::connector_id(1), "CRTC_ID", FakeKmsDevice::crtc_id(0));
  auto choice = choose_display(device, "HDMI-A-1", "");
  ASSERT_TRUE(choice) << choice.error().what;
  EXPECT_EQ(choice->crtc, FakeKmsDevice::crtc_id(1));
  EXPECT_EQ(choice->plane.id, FakeKmsDevice::primary_id(1));
  // What it has already is kept.
  choice = choose_display(device, "DP-1", "");
  EXPECT_EQ(choice->crtc, FakeKmsDevice::crtc_id(0));
  device.set_value(FakeKmsDevice::connector_id(2), "CRTC_ID", FakeKmsDevice::crtc_id(1));
  const auto none = choose_display(device, "HDMI-A-1", "");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kUnavailable);
}

}  // namespace
}  // namespace veneer::projector
