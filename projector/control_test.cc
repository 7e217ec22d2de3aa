// SPDX-License-Identifier: Apache-2.0
#include "projector/control.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

namespace veneer::projector {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

ProjectorState whole_state() {
  ProjectorState state;
  state.power = Power::kOn;
  state.input = "digital1";
  state.input_label = "HDMI left";
  state.input_resolution = Resolution{1920, 1080};
  state.panel_resolution = Resolution{1920, 1080};
  state.muted = false;
  state.frozen = false;
  state.locked = true;
  state.lamps = {{1234, true}, {99, false}};
  state.health = {{"fan", Health::kOk}, {"lamp", Health::kOk}};
  state.degamma = false;
  state.processing = true;
  state.led_levels = LedLevels{100, 120, 90};
  state.led_enable = "sequencer";
  state.maker = "Maker";
  state.model = "Model";
  state.name = "Hall 3";
  state.serial = "S1";
  state.firmware = "4.1.0";
  return state;
}

TEST(ProjectorState, WhatIsNotToldIsNotInTheRecord) {
  EXPECT_THAT(to_record({}), IsEmpty());
  const ControlRecord record = to_record(whole_state());
  EXPECT_EQ(record.at("projector.lamp_hours"), "1234 99");
  EXPECT_EQ(record.at("projector.lamps_on"), "on off");
  EXPECT_EQ(record.at("projector.led_levels"), "100 120 90");
  EXPECT_EQ(record.at("projector.degamma"), "off");
  EXPECT_EQ(record.at("projector.health.fan"), "ok");
  EXPECT_EQ(record.at("projector.input_resolution"), "1920x1080");
  EXPECT_EQ(record.size(), 21U);  // 19 values and two parts' health
}

TEST(ProjectorState, AStateDoesNotDifferFromItselfOrFromSilence) {
  EXPECT_THAT(differences(whole_state(), whole_state()), IsEmpty());
  EXPECT_THAT(differences(whole_state(), ProjectorState{}), IsEmpty());
  EXPECT_THAT(differences(ProjectorState{}, whole_state()), IsEmpty());
}

TEST(ProjectorState, EveryChangeThatMovesColoursIsNamedAlone) {
  const std::vector<std::pair<const char*, std::function<void(ProjectorState&)>>> changes{
      {"the power was \"on\" and is \"cooling\"",
       [](ProjectorState& s) { s.power = Power::kCooling; }},
      {"input", [](ProjectorState& s) { s.input = "rgb1"; }},
      {"resolution of the input was \"1920x1080\"",
       [](ProjectorState& s) {
         s.input_resolution = Resolution{1280, 720};
       }},
      {"mute", [](ProjectorState& s) { s.muted = true; }},
      {"freeze", [](ProjectorState& s) { s.frozen = true; }},
      {"degamma", [](ProjectorState& s) { s.degamma = true; }},
      {"processing", [](ProjectorState& s) { s.processing = false; }},
      {"LED levels",
       [](ProjectorState& s) {
         s.led_levels = LedLevels{100, 120, 91};
       }},
      {"what lights the LEDs", [](ProjectorState& s) { s.led_enable = "red blue"; }},
      {"which lamps burn",
       [](ProjectorState& s) {
         s.lamps = {{1234, true}, {99, true}};
       }},
      {"lamp 1 was replaced",
       [](ProjectorState& s) {
         s.lamps = {{3, true}, {99, false}};
       }},
      {"model", [](ProjectorState& s) { s.model = "Other"; }},
      {"serial", [](ProjectorState& s) { s.serial = "S2"; }},
      {"firmware", [](ProjectorState& s) { s.firmware = "4.4.0"; }},
  };
  for (const auto& [text, change] : changes) {
    ProjectorState now = whole_state();
    change(now);
    EXPECT_THAT(differences(whole_state(), now), ElementsAre(HasSubstr(text)));
  }
}

TEST(ProjectorState, HoursThatPassAndANameAreNoChange) {
  ProjectorState now = whole_state();
  now.lamps = {{1250, true}, {99, false}};
  now.name = "Hall 4";
  now.health["fan"] = Health::kWarning;
  EXPECT_THAT(differences(whole_state(), now), IsEmpty());
}

TEST(ProjectorState, ARecordThatSomebodyWroteDoesNotConfuseIt) {
  ControlRecord then = to_record(whole_state());
  for (const char* text : {"", "x", "-", "99999999999999999999", "12 x", " 5"}) {
    then["projector.lamp_hours"] = text;
    EXPECT_THAT(differences(then, to_record(whole_state())), IsEmpty()) << text;
  }
}

TEST(ProjectorState, WhatSpoilsColoursIsWarnedOf) {
  EXPECT_THAT(warnings(whole_state()), IsEmpty());
  EXPECT_THAT(warnings({}), IsEmpty());
  ProjectorState bad = whole_state();
  bad.power = Power::kWarmUp;
  bad.frozen = true;
  bad.muted = true;
  bad.degamma = true;
  bad.locked = false;
  bad.health["fan"] = Health::kError;
  EXPECT_THAT(warnings(bad),
              ElementsAre(HasSubstr("warming up"),
                          HasSubstr("unfreeze"),
                          HasSubstr("unblank"),
                          HasSubstr("degamma"),
                          HasSubstr("cable"),
                          HasSubstr("fan error")));
}

TEST(ProjectorState, WhatWasSoWhenItWasMeasuredIsNotWarnedOf) {
  ProjectorState then = whole_state();
  then.degamma = true;
  then.locked = false;
  then.health = {{"fan", Health::kWarning}, {"lamp", Health::kError}};
  EXPECT_EQ(warnings(then).size(), 4U);
  EXPECT_THAT(warnings(then, to_record(then)), IsEmpty());
  ProjectorState now = then;
  now.health["lamp"] = Health::kWarning;  // better than it was
  EXPECT_THAT(warnings(now, to_record(then)), IsEmpty());
  now.health["fan"] = Health::kError;  // worse
  EXPECT_THAT(warnings(now, to_record(then)), ElementsAre(HasSubstr("fan error")));
  // A record that says otherwise, or nothing, takes no warning away.
  EXPECT_EQ(warnings(then, to_record(whole_state())), warnings(then));
  EXPECT_EQ(warnings(then, {}), warnings(then));
}

TEST(ProjectorState, APictureThatIsScaledIsWarnedOfUnlessItWasMeasuredSo) {
  ProjectorState scaled = whole_state();
  scaled.input_resolution = Resolution{1280, 720};
  EXPECT_THAT(warnings(scaled), ElementsAre(HasSubstr("1280 x 720 pixels to 1920 x 1080")));
  EXPECT_THAT(warnings(scaled, to_record(scaled)), IsEmpty());
  EXPECT_EQ(warnings(scaled, to_record(whole_state())).size(), 1U);
  ProjectorState half_told = scaled;
  half_told.panel_resolution.reset();
  EXPECT_THAT(warnings(half_told), IsEmpty());
}

TEST(ProjectorState, NoRecordMakesAHiddenPictureRight) {
  ProjectorState hidden = whole_state();
  hidden.power = Power::kOff;
  hidden.frozen = true;
  hidden.muted = true;
  EXPECT_EQ(warnings(hidden, to_record(hidden)).size(), 3U);
}

/// Has only what every control must have.
class PlainControl final : public ProjectorControl {
 public:
  [[nodiscard]] std::string description() const override { return "the plain one"; }
  [[nodiscard]] Result<ProjectorState> read_state() override { return ProjectorState{}; }
  [[nodiscard]] Status power(bool) override { return {}; }
  [[nodiscard]] Status mute(bool) override { return {}; }
  [[nodiscard]] Status freeze(bool) override { return {}; }
  [[nodiscard]] Status select_input(const std::string&) override { return {}; }
};

TEST(ProjectorControl, WhatAProjectorCannotIsSaidWithItsName) {
  PlainControl control;
  for (const Status& status : {control.set_degamma(false),
                               control.set_led_levels({1, 2, 3}),
                               control.set_processing(false),
                               control.show_test_pattern("solid")}) {
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, Errc::kUnavailable);
    EXPECT_THAT(status.error().what, HasSubstr("the plain one"));
  }
}

}  // namespace
}  // namespace veneer::projector
