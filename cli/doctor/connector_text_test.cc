// SPDX-License-Identifier: Apache-2.0
#include "cli/doctor/connector_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace veneer::cli {
namespace {

using projector::KmsDisplay;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

KmsDisplay hall() {
  return {"/dev/dri/card0",
          "i915",
          "HDMI-A-1",
          true,
          true,
          "SEC",
          "EPSON PJ",
          "X1234",
          {"1920x1200@59.95", "1920x1080@60.00", "1024x768@60.00"}};
}

TEST(ConnectorText, SaysWhatAConfigurationCanName) {
  const std::string text = text_of(hall());
  for (const char* each :
       {"HDMI-A-1", "/dev/dri/card0", "i915", "SEC EPSON PJ, serial X1234", "1920x1200@59.95"})
    EXPECT_THAT(text, HasSubstr(each));
  EXPECT_THAT(text, HasSubstr("and 2 more modes"));
  EXPECT_THAT(text, EndsWith("; in use"));
  EXPECT_EQ(text.find('\n'), std::string::npos);
}

TEST(ConnectorText, LeavesOutWhatTheDisplayDoesNotSay) {
  KmsDisplay display = hall();
  display.in_use = false;
  display.modes.resize(1);
  EXPECT_THAT(text_of(display), EndsWith("1920x1200@59.95"));
  display.modes.push_back("1024x768@60.00");
  EXPECT_THAT(text_of(display), EndsWith("and 1 more mode"));
  display.modes.clear();
  EXPECT_THAT(text_of(display), EndsWith("no mode"));
  display.serial.clear();
  EXPECT_THAT(text_of(display), HasSubstr(": SEC EPSON PJ; "));
  display.maker.clear();
  EXPECT_THAT(text_of(display), HasSubstr(": EPSON PJ; "));
  display.name.clear();
  EXPECT_THAT(text_of(display), HasSubstr(": a display without a name; "));
  display.serial = "7";
  EXPECT_THAT(text_of(display), HasSubstr(": serial 7; "));
}

TEST(ConnectorText, OfAnEmptySocketSaysNothingOfADisplay) {
  KmsDisplay display = hall();
  display.connected = false;
  EXPECT_THAT(text_of(display), EndsWith("nothing is plugged in"));
  EXPECT_THAT(text_of(display), Not(HasSubstr("EPSON")));
}

TEST(ConnectorText, OfAProgramHasAll) {
  const KmsDisplay display = hall();
  const nlohmann::ordered_json json = json_of(display);
  EXPECT_EQ(json.at("device"), display.device);
  EXPECT_EQ(json.at("driver"), display.driver);
  EXPECT_EQ(json.at("connector"), display.connector);
  EXPECT_EQ(json.at("connected"), true);
  EXPECT_EQ(json.at("in_use"), true);
  EXPECT_EQ(json.at("maker"), display.maker);
  EXPECT_EQ(json.at("name"), display.name);
  EXPECT_EQ(json.at("serial"), display.serial);
  EXPECT_EQ(json.at("modes").get<std::vector<std::string>>(), display.modes);
}

}  // namespace
}  // namespace veneer::cli
