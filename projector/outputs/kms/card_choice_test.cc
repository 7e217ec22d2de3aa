// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/card_choice.h"

#include <gtest/gtest.h>

#include <map>

#include "base/exit_code.h"
#include "projector/outputs/kms/fake_kms_device.h"
#include "projector/outputs/kms/kms_output.h"

namespace veneer::projector {
namespace {

/// A machine whose first card feeds the monitor of the desk and whose second one the projector.
class CardChoiceTest : public testing::Test {
 protected:
  CardChoiceTest() {
    const std::vector<KmsMode> modes{fake_mode(64, 48, 60, true)};
    desk_.path = "/dev/dri/card0";
    desk_.connectors = {{"DP-1", fake_edid("DELL", "B2"), true, modes},
                        {"HDMI-A-1", fake_edid("LG", "C3"), true, modes}};
    stage_.path = "/dev/dri/card1";
    stage_.connectors = {{"HDMI-A-2", fake_edid("EPSON PJ", "A1"), true, modes}};
    options_.buffers = KmsOutputOptions::Buffers::kMapped;
  }
  [[nodiscard]] KmsCards cards() {
    return {{desk_.path, stage_.path},
            [this](const std::filesystem::path& path) -> Result<std::unique_ptr<KmsDevice>> {
              if (const auto bad = unopenable_.find(path.string()); bad != unopenable_.end())
                return fail(bad->second, "opening {} fails", path.string());
              return std::make_unique<FakeKmsDevice>(path == desk_.path ? desk_ : stage_, clock_);
            }};
  }
  Result<std::unique_ptr<KmsOutput>> open(const std::string& connector) {
    options_.connector = connector;
    return KmsOutput::open(options_, cards(), clock_);
  }
  /// "/dev/dri/card1 HDMI-A-2" of what was opened, or the error.
  std::string opened(const std::string& connector) {
    const auto output = open(connector);
    if (!output) return output.error().what;
    const std::string text = (*output)->description();
    const std::string& socket = (*output)->display().connector.name;
    for (const FakeCard* card : {&desk_, &stage_}) {
      if (text.find(card->path) != std::string::npos) return card->path + " " + socket;
    }
    return text;
  }

  VirtualClock clock_{Time(std::chrono::seconds(5))};
  FakeCard desk_;
  FakeCard stage_;
  std::map<std::string, Errc> unopenable_;
  KmsOutputOptions options_;
};

TEST_F(CardChoiceTest, ADisplayIsFoundOnWhateverCardItIs) {
  for (const char* name : {"EPSON PJ", "A1", "HDMI-A-2"})
    EXPECT_EQ(opened(name), "/dev/dri/card1 HDMI-A-2") << name;
  for (const char* name : {"DELL", "B2", "DP-1"})
    EXPECT_EQ(opened(name), "/dev/dri/card0 DP-1") << name;
}

TEST_F(CardChoiceTest, TheSameDisplayOnTwoCardsIsRefused) {
  stage_.connectors[0].edid = desk_.connectors[0].edid;
  const auto output = open("DELL");
  ASSERT_FALSE(output);
  EXPECT_EQ(output.error().code, Errc::kInvalidOption);
  EXPECT_NE(output.error().what.find("2 cards have a display \"DELL\""), std::string::npos)
      << output.error().what;
}

TEST_F(CardChoiceTest, TheOtherCardIsLeftAlone) {
  ASSERT_TRUE(open("EPSON PJ"));
  EXPECT_EQ(desk_.masters_asked, 0);
  EXPECT_EQ(desk_.full_commits, 0);
}

TEST_F(CardChoiceTest, WithoutANameTheFirstCardWithADisplayIsTaken) {
  EXPECT_NE(opened("").find("2 displays on /dev/dri/card0"), std::string::npos) << opened("");
  desk_.connectors.pop_back();
  EXPECT_EQ(opened(""), "/dev/dri/card0 DP-1");
  desk_.connectors[0].connected = false;
  EXPECT_EQ(opened(""), "/dev/dri/card1 HDMI-A-2");
}

TEST_F(CardChoiceTest, WhatIsNowhereListsEverySocketOfEveryCard) {
  const auto output = open("SONY");
  ASSERT_FALSE(output);
  EXPECT_EQ(exit_code_of(output.error()), kExitUsage);
  for (const char* part : {"SONY",
                           "/dev/dri/card0 DP-1: DELL, serial B2; modes: 64x48@60.00",
                           "/dev/dri/card0 HDMI-A-1: LG, serial C3",
                           "/dev/dri/card1 HDMI-A-2: EPSON PJ, serial A1"})
    EXPECT_NE(output.error().what.find(part), std::string::npos)
        << part << " is not in: " << output.error().what;
}

TEST_F(CardChoiceTest, AProjectorThatIsOffOnAnotherCardIsTriedAgain) {
  stage_.connectors[0].connected = false;
  stage_.connectors[0].edid.clear();
  const auto by_name = open("EPSON PJ");
  ASSERT_FALSE(by_name);
  EXPECT_EQ(exit_code_of(by_name.error()), kExitFailed) << by_name.error().what;
  EXPECT_NE(by_name.error().what.find("/dev/dri/card1 HDMI-A-2 (nothing connected)"),
            std::string::npos)
      << by_name.error().what;
  const auto by_socket = open("HDMI-A-2");
  ASSERT_FALSE(by_socket);
  EXPECT_EQ(exit_code_of(by_socket.error()), kExitFailed);
  EXPECT_NE(by_socket.error().what.find("nothing is connected to HDMI-A-2 of /dev/dri/card1"),
            std::string::npos)
      << by_socket.error().what;
}

TEST_F(CardChoiceTest, ASocketThatTwoCardsHaveIsRefusedWhicheverHasADisplayJustNow) {
  stage_.connectors[0].name = "DP-1";
  for (const auto& [at_desk, on_stage] : {std::pair(true, true),
                                          std::pair(true, false),
                                          std::pair(false, true),
                                          std::pair(false, false)}) {
    desk_.connectors[0].connected = at_desk;
    stage_.connectors[0].connected = on_stage;
    const auto output = open("DP-1");
    ASSERT_FALSE(output);
    EXPECT_EQ(output.error().code, Errc::kInvalidOption);
    EXPECT_NE(output.error().what.find("2 cards have a socket \"DP-1\"; set device too"),
              std::string::npos)
        << output.error().what;
  }
  options_.device = stage_.path;
  stage_.connectors[0].connected = desk_.connectors[0].connected = true;
  EXPECT_EQ(opened("DP-1"), "/dev/dri/card1 DP-1");
}

TEST_F(CardChoiceTest, ACardThatCannotBeOpenedIsNamedAndOthersAreUsed) {
  unopenable_[desk_.path] = Errc::kIo;
  EXPECT_EQ(opened("EPSON PJ"), "/dev/dri/card1 HDMI-A-2");
  // It may have been that card's: udev may not have given it to this user yet.
  const auto output = open("DELL");
  ASSERT_FALSE(output);
  EXPECT_EQ(exit_code_of(output.error()), kExitFailed);
  EXPECT_NE(output.error().what.find("opening /dev/dri/card0 fails"), std::string::npos)
      << output.error().what;
  // One that shows nothing at all hides none.
  unopenable_[desk_.path] = Errc::kUnavailable;
  EXPECT_EQ(exit_code_of(open("DELL").error()), kExitUsage);
  unopenable_[stage_.path] = Errc::kUnavailable;
  EXPECT_NE(opened("DELL").find("no card can show a picture"), std::string::npos);
}

TEST_F(CardChoiceTest, AMachineWithoutACardIsSaid) {
  const auto none = choose_card({{}, open_kms_device}, "");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kNotFound);
}

}  // namespace
}  // namespace veneer::projector
