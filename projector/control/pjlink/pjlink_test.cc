// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/pjlink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <string>
#include <thread>

#include "projector/control/pjlink/fake_projector.h"

namespace veneer::projector {
namespace {

using namespace std::chrono_literals;
using pjlink::FakeProjector;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A class 1 projector that is well.
FakeProjector::Behaviour class_1() {
  FakeProjector::Behaviour behaviour;
  behaviour.replies = {{"%1CLSS ?\r", "%1CLSS=1\r"},
                       {"%1POWR ?\r", "%1POWR=1\r"},
                       {"%1INPT ?\r", "%1INPT=31\r"},
                       {"%1AVMT ?\r", "%1AVMT=30\r"},
                       {"%1ERST ?\r", "%1ERST=000010\r"},
                       {"%1LAMP ?\r", "%1LAMP=1234 1\r"},
                       {"%1INF1 ?\r", "%1INF1=Maker\r"},
                       {"%1INF2 ?\r", "%1INF2=Model\r"},
                       {"%1NAME ?\r", "%1NAME=Hall 3\r"},
                       {"%1POWR 1\r", "%1POWR=OK\r"},
                       {"%1POWR 0\r", "%1POWR=OK\r"},
                       {"%1AVMT 11\r", "%1AVMT=OK\r"},
                       {"%1AVMT 10\r", "%1AVMT=OK\r"},
                       {"%1INPT 31\r", "%1INPT=OK\r"}};
  return behaviour;
}

FakeProjector::Behaviour class_2() {
  FakeProjector::Behaviour behaviour = class_1();
  behaviour.replies["%1CLSS ?\r"] = "%1CLSS=2\r";
  behaviour.replies["%2INPT ?\r"] = "%2INPT=3A\r";
  behaviour.replies["%2FREZ ?\r"] = "%2FREZ=1\r";
  behaviour.replies["%2FREZ 0\r"] = "%2FREZ=OK\r";
  behaviour.replies["%2IRES ?\r"] = "%2IRES=1280x720\r";
  behaviour.replies["%2RRES ?\r"] = "%2RRES=1920x1080\r";
  behaviour.replies["%2INNM ?3A\r"] = "%2INNM=HDMI left\r";
  behaviour.replies["%2SNUM ?\r"] = "%2SNUM=S123\r";
  behaviour.replies["%2SVER ?\r"] = "%2SVER=1.02\r";
  return behaviour;
}

std::string reply_to(const std::string& request, const std::string& parameter) {
  return request.substr(0, 6) + "=" + parameter + "\r";
}

constexpr const char* kAllOfClass1 =
    "%1CLSS ?\r%1POWR ?\r%1INPT ?\r%1AVMT ?\r%1ERST ?\r%1LAMP ?\r%1INF1 ?\r%1INF2 ?\r%1NAME ?\r";

class PjlinkConversation : public ::testing::Test {
 protected:
  Pjlink control(const FakeProjector& projector, const std::string& password = "") {
    PjlinkOptions options;
    options.host = "127.0.0.1";
    options.port = projector.port();
    options.password = password;
    options.time_limit = limit_;
    return Pjlink(options, clock_);
  }
  VirtualClock clock_;
  Duration limit_ = 5s;
};

TEST_F(PjlinkConversation, EveryByteOfAClass1StatusIsAsLaidDown) {
  FakeProjector projector(class_1());
  Pjlink control = this->control(projector);
  const auto state = control.read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_THAT(projector.conversations(), ElementsAre(kAllOfClass1));
  ProjectorState expected;
  expected.power = Power::kOn;
  expected.input = "digital1";
  expected.muted = false;
  expected.lamps = {{1234, true}};
  expected.health = {{"fan", Health::kOk},
                     {"lamp", Health::kOk},
                     {"temperature", Health::kOk},
                     {"cover", Health::kOk},
                     {"filter", Health::kWarning},
                     {"other", Health::kOk}};
  expected.maker = "Maker";
  expected.model = "Model";
  expected.name = "Hall 3";
  EXPECT_EQ(*state, expected);
}

TEST_F(PjlinkConversation, Class2IsAskedForWhatClass1DoesNotKnow) {
  FakeProjector projector(class_2());
  Pjlink control = this->control(projector);
  const auto state = control.read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->input, "digitalA");
  EXPECT_EQ(state->frozen, true);
  EXPECT_EQ(state->serial, "S123");
  EXPECT_EQ(state->firmware, "1.02");
  EXPECT_EQ(state->input_label, "HDMI left");
  EXPECT_EQ(state->input_resolution, (Resolution{1280, 720}));
  EXPECT_EQ(state->panel_resolution, (Resolution{1920, 1080}));
  EXPECT_EQ(state->locked, true);
  EXPECT_TRUE(control.freeze(false));
  EXPECT_THAT(projector.conversations().front(),
              ::testing::EndsWith("%2FREZ ?\r%2IRES ?\r%2RRES ?\r%2INNM ?3A\r%2SNUM ?\r%2SVER ?\r"
                                  "%2FREZ 0\r"));
}

TEST_F(PjlinkConversation, NoSignalIsToldApartFromOneThatIsNotKnown) {
  FakeProjector projector(class_2());
  for (const auto& [answer, locked] : {std::pair{"-", std::optional(false)},
                                       std::pair{"*", std::optional<bool>()},
                                       std::pair{"ERR3", std::optional<bool>()}}) {
    projector.reply("%2IRES ?\r", reply_to("%2IRES ?", answer));
    const auto state = this->control(projector).read_state();
    ASSERT_TRUE(state) << state.error().what;
    EXPECT_EQ(state->locked, locked) << answer;
    EXPECT_FALSE(state->input_resolution) << answer;
  }
  // One that is off has no signal either, which is nothing to see to.
  projector.reply("%2IRES ?\r", "%2IRES=-\r");
  projector.reply("%1POWR ?\r", "%1POWR=0\r");
  const auto off = this->control(projector).read_state();
  ASSERT_TRUE(off) << off.error().what;
  EXPECT_FALSE(off->locked);
}

TEST_F(PjlinkConversation, ThePasswordGoesBeforeTheFirstRequestAlone) {
  FakeProjector::Behaviour behaviour = class_1();
  behaviour.greeting = "PJLINK 1 498e4a67\r";
  FakeProjector projector(behaviour);
  Pjlink control = this->control(projector, "JBMIAProjectorLink");
  ASSERT_TRUE(control.mute(true));
  ASSERT_TRUE(control.mute(false));
  // printf '498e4a67JBMIAProjectorLink' | md5sum
  EXPECT_THAT(projector.conversations(),
              ElementsAre("5d8409bc1c3fa39749434aa3a5c38682%1AVMT 11\r%1AVMT 10\r"));
}

TEST_F(PjlinkConversation, AWrongPasswordIsSaidWhereverItIsRefused) {
  FakeProjector::Behaviour behaviour = class_1();
  behaviour.greeting = "PJLINK 1 498e4a67\r";
  for (auto& [request, reply] : behaviour.replies) reply = "PJLINK ERRA\r";
  FakeProjector projector(behaviour);
  for (const auto& done : {this->control(projector, "wrong").mute(true),
                           this->control(projector, "wrong").power(true),
                           this->control(projector).mute(true)}) {
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, Errc::kInvalidOption);
    EXPECT_THAT(done.error().what, HasSubstr("password"));
  }
  projector.greet("PJLINK ERRA\r");
  const auto state = this->control(projector, "wrong").read_state();
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().code, Errc::kInvalidOption);
}

TEST_F(PjlinkConversation, EveryRefusalOfACommandSaysWhatToDo) {
  FakeProjector projector(class_1());
  const std::array expected{std::pair{Errc::kUnavailable, "does not know"},
                            std::pair{Errc::kInvalidOption, "does not take"},
                            std::pair{Errc::kUnavailable, "warming up or cooling"},
                            std::pair{Errc::kIo, "has failed"}};
  Pjlink control = this->control(projector);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    projector.reply("%1INPT 31\r", fmt::format("%1INPT=ERR{}\r", i + 1));
    const Status done = control.select_input("digital1");
    ASSERT_FALSE(done) << i;
    EXPECT_EQ(done.error().code, expected.at(i).first);
    EXPECT_THAT(done.error().what, HasSubstr(expected.at(i).second));
  }
  projector.reply("%1INPT 31\r", "%1INPT=OK\r");
  EXPECT_TRUE(control.select_input("31"));
  EXPECT_EQ(projector.conversations().size(), 1U);  // a refusal is no reason to hang up
}

struct Asked {
  const char* request;  // without its CR
  bool (*is_empty)(const ProjectorState&);
};
constexpr std::array kAsked{
    Asked{"%1POWR ?", [](const ProjectorState& s) { return s.power == Power::kUnknown; }},
    Asked{"%2INPT ?", [](const ProjectorState& s) { return !s.input; }},
    Asked{"%1AVMT ?", [](const ProjectorState& s) { return !s.muted; }},
    Asked{"%1ERST ?", [](const ProjectorState& s) { return !s.health.contains("fan"); }},
    Asked{"%1LAMP ?", [](const ProjectorState& s) { return !s.lamps; }},
    Asked{"%1INF1 ?", [](const ProjectorState& s) { return !s.maker; }},
    Asked{"%1INF2 ?", [](const ProjectorState& s) { return !s.model; }},
    Asked{"%1NAME ?", [](const ProjectorState& s) { return !s.name; }},
    Asked{"%2FREZ ?", [](const ProjectorState& s) { return !s.frozen; }},
    Asked{"%2IRES ?", [](const ProjectorState& s) { return !s.input_resolution; }},
    Asked{"%2RRES ?", [](const ProjectorState& s) { return !s.panel_resolution; }},
    Asked{"%2INNM ?3A", [](const ProjectorState& s) { return !s.input_label; }},
    Asked{"%2SNUM ?", [](const ProjectorState& s) { return !s.serial; }},
    Asked{"%2SVER ?", [](const ProjectorState& s) { return !s.firmware; }}};

TEST_F(PjlinkConversation, EveryRefusalOfEveryQuestionLeavesThatOneValueEmpty) {
  for (const Asked& asked : kAsked) {
    const std::string request = asked.request;
    FakeProjector projector(class_2());
    for (int refusal = 1; refusal <= 4; ++refusal) {
      projector.reply(request + "\r", reply_to(request, fmt::format("ERR{}", refusal)));
      const auto state = this->control(projector).read_state();
      ASSERT_TRUE(state) << request << " " << state.error().what;
      for (const Asked& other : kAsked)
        EXPECT_EQ(other.is_empty(*state),
                  other.request == asked.request ||
                      // What is not known cannot be asked for its name.
                      (other.request == std::string("%2INNM ?3A") && request == "%2INPT ?"))
            << other.request << " beside " << request;
      const bool failed =
          state->health.contains("other") && state->health.at("other") == Health::kError;
      EXPECT_EQ(failed, refusal == 4) << request << " ERR" << refusal;
    }
    for (const char* wrong : {"ERRA", "ERR0", "ERR5"}) {
      projector.reply(request + "\r", reply_to(request, wrong));
      const auto state = this->control(projector).read_state();
      // Names are texts, and a projector may well be called ERR5.
      // What is no resolution is none.
      const bool is_text = request.find("IRES") == 2 || request.find("RRES") == 2 ||
                           request.find("INNM") == 2 || request.find("INF") == 2 ||
                           request.find("NAME") == 2 || request.find("SNUM") == 2 ||
                           request.find("SVER") == 2;
      if (is_text && std::string(wrong) != "ERRA") {
        EXPECT_TRUE(state) << request << wrong;
        continue;
      }
      ASSERT_FALSE(state) << request << wrong;
      EXPECT_EQ(state.error().code,
                std::string(wrong) == "ERRA" ? Errc::kInvalidOption : Errc::kBadFormat);
    }
  }
}

TEST_F(PjlinkConversation, EveryRefusalOfEveryCommandIsTold) {
  struct Command {
    const char* request;  // without its CR
    Status (*act)(Pjlink&);
  };
  const std::array commands{
      Command{"%1POWR 1", [](Pjlink& c) { return c.power(true); }},
      Command{"%1POWR 0", [](Pjlink& c) { return c.power(false); }},
      Command{"%1AVMT 11", [](Pjlink& c) { return c.mute(true); }},
      Command{"%1AVMT 10", [](Pjlink& c) { return c.mute(false); }},
      Command{"%2FREZ 1", [](Pjlink& c) { return c.freeze(true); }},
      Command{"%2FREZ 0", [](Pjlink& c) { return c.freeze(false); }},
      Command{"%2INPT 3A", [](Pjlink& c) { return c.select_input("digitalA"); }}};
  constexpr std::array kExpected{std::pair{"ERR1", Errc::kUnavailable},
                                 std::pair{"ERR2", Errc::kInvalidOption},
                                 std::pair{"ERR3", Errc::kUnavailable},
                                 std::pair{"ERR4", Errc::kIo},
                                 std::pair{"ERRA", Errc::kInvalidOption},
                                 std::pair{"ERR5", Errc::kBadFormat},
                                 std::pair{"ok", Errc::kBadFormat}};
  for (const Command& command : commands) {
    const std::string request = command.request;
    FakeProjector projector(class_2());
    for (const auto& [parameter, code] : kExpected) {
      projector.reply(request + "\r", reply_to(request, parameter));
      for (const char* both : {"%1AVMT 31\r", "%1AVMT 30\r"})
        projector.reply(both, reply_to(request, parameter));
      Pjlink control = this->control(projector);
      const Status done = command.act(control);
      ASSERT_FALSE(done) << request << " " << parameter;
      EXPECT_EQ(done.error().code, code)
          << request << " " << parameter << ": " << done.error().what;
    }
    projector.reply(request + "\r", reply_to(request, "OK"));
    Pjlink control = this->control(projector);
    EXPECT_TRUE(command.act(control)) << request;
  }
}

TEST_F(PjlinkConversation, OnlyAGreetingIsTakenForOne) {
  FakeProjector projector(class_1());
  const auto greeted = [&](const std::string& greeting) {
    projector.greet(greeting);
    return this->control(projector, "secret").mute(true);
  };
  EXPECT_TRUE(greeted("PJLINK 0\r"));
  EXPECT_TRUE(greeted("PJLINK 1 0123ABCD\r"));
  for (const char* wrong : {"PJLINK 2\r",
                            "PJLINK 0 \r",
                            "PJLINK 1\r",
                            "PJLINK 1 \r",
                            "PJLINK 1 0123abc\r",
                            "PJLINK 1 0123abcde\r",
                            "PJLINK 1 0123abcg\r",
                            "pjlink 0\r",
                            " PJLINK 0\r",
                            "PJLINK ERR1\r",
                            "%1AVMT=OK\r"}) {
    const Status done = greeted(wrong);
    ASSERT_FALSE(done) << wrong;
    EXPECT_EQ(done.error().code, Errc::kBadFormat) << wrong << done.error().what;
  }
  const Status refused = greeted("PJLINK ERRA\r");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kInvalidOption);
}

TEST_F(PjlinkConversation, OneThatHangsUpInTheMiddleOfALineIsReported) {
  for (const char* half : {"%", "%1AVMT", "%1AVMT=OK"}) {
    FakeProjector::Behaviour behaviour = class_1();
    behaviour.replies_a_connection = 1;
    behaviour.replies["%1AVMT 11\r"] = half;
    FakeProjector projector(behaviour);
    const Status done = this->control(projector).mute(true);
    ASSERT_FALSE(done) << half;
    EXPECT_EQ(done.error().code, Errc::kDisconnected);
  }
}

TEST_F(PjlinkConversation, AReplyOfAnotherClassIsNoReply) {
  FakeProjector projector(class_2());
  projector.reply("%1AVMT 11\r", "%2AVMT=OK\r");
  EXPECT_EQ(this->control(projector).mute(true).error().code, Errc::kBadFormat);
  projector.reply("%2FREZ 0\r", "%1FREZ=OK\r");
  EXPECT_EQ(this->control(projector).freeze(false).error().code, Errc::kBadFormat);
}

TEST_F(PjlinkConversation, WhoeverSendsForEverIsNotListenedTo) {
  FakeProjector::Behaviour flood = class_1();
  flood.greeting = std::string(4U << 20U, 'x');
  FakeProjector projector(flood);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(this->control(projector).mute(true).error().code, Errc::kBadFormat);
  EXPECT_LT(std::chrono::steady_clock::now() - start, 2s);
}

TEST_F(PjlinkConversation, ALaserHasNoLampsAndOneInStandbyNoInput) {
  FakeProjector projector(class_1());
  projector.reply("%1LAMP ?\r", "%1LAMP=ERR1\r");
  projector.reply("%1POWR ?\r", "%1POWR=0\r");
  projector.reply("%1INPT ?\r", "%1INPT=ERR3\r");
  projector.reply("%1AVMT ?\r", "%1AVMT=ERR2\r");
  const auto state = this->control(projector).read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->power, Power::kOff);
  EXPECT_FALSE(state->lamps);
  EXPECT_FALSE(state->input);
  EXPECT_FALSE(state->muted);
}

TEST_F(PjlinkConversation, AFailureThatItConfessesToAQuestionIsBadHealth) {
  FakeProjector projector(class_1());
  projector.reply("%1POWR ?\r", "%1POWR=ERR4\r");
  const auto state = this->control(projector).read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->power, Power::kUnknown);
  EXPECT_EQ(state->health.at("other"), Health::kError);
}

TEST_F(PjlinkConversation, ItIsNotAskedMoreOftenThanEvery2Seconds) {
  FakeProjector projector(class_1());
  Pjlink control = this->control(projector);
  const std::string once = kAllOfClass1;
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(control.read_state());
  EXPECT_THAT(projector.conversations(), ElementsAre(once));
  clock_.sleep_until(clock_.now() + 2s);
  ASSERT_TRUE(control.read_state());
  // Its class is known by now.
  const std::string again = once.substr(std::string("%1CLSS ?\r").size());
  EXPECT_THAT(projector.conversations(), ElementsAre(once + again));
  // What a command changed is asked for at once.
  projector.reply("%1AVMT ?\r", "%1AVMT=31\r");
  ASSERT_TRUE(control.mute(true));
  EXPECT_EQ(control.read_state()->muted, true);
}

TEST_F(PjlinkConversation, AnIdleConnectionIsMadeAnewSilently) {
  FakeProjector projector(class_1());
  Pjlink control = this->control(projector);
  ASSERT_TRUE(control.mute(true));
  clock_.sleep_until(clock_.now() + 26s);
  ASSERT_TRUE(control.mute(false));
  EXPECT_THAT(projector.conversations(), ElementsAre("%1AVMT 11\r", "%1AVMT 10\r"));
}

TEST_F(PjlinkConversation, OneThatHungUpMeanwhileIsConnectedToAgain) {
  FakeProjector::Behaviour behaviour = class_1();
  behaviour.replies_a_connection = 1;
  FakeProjector projector(behaviour);
  Pjlink control = this->control(projector);
  ASSERT_TRUE(control.mute(true));
  projector.wait_for_end();
  ASSERT_TRUE(control.mute(false));
  EXPECT_THAT(projector.conversations(), ElementsAre("%1AVMT 11\r", "%1AVMT 10\r"));
}

TEST_F(PjlinkConversation, OneThatDiesInTheMiddleIsAskedOnceMoreAndNoMore) {
  FakeProjector projector(class_1());
  Pjlink control = this->control(projector);
  ASSERT_TRUE(control.mute(true));
  projector.reply("%1AVMT 10\r", "");  // hangs up instead
  const Status done = control.mute(false);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::kDisconnected);
  EXPECT_THAT(projector.conversations(), ElementsAre("%1AVMT 11\r%1AVMT 10\r", "%1AVMT 10\r"));
  // A fresh connection that dies is not tried again by itself, and the next call begins afresh.
  projector.reply("%1AVMT 10\r", "%1AVMT=OK\r");
  EXPECT_TRUE(control.mute(false));
}

TEST_F(PjlinkConversation, OneThatSendsByteByByteIsUnderstood) {
  FakeProjector::Behaviour behaviour = class_1();
  behaviour.byte_delay = 1ms;
  FakeProjector projector(behaviour);
  Pjlink control = this->control(projector);
  const auto state = control.read_state();
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(state->name, "Hall 3");
}

TEST_F(PjlinkConversation, LinesThatEndWithCrLfAreUnderstood) {
  FakeProjector::Behaviour behaviour = class_1();
  behaviour.greeting = "PJLINK 0\r\n";
  for (auto& [request, reply] : behaviour.replies) reply += '\n';
  FakeProjector projector(behaviour);
  Pjlink control = this->control(projector);
  ASSERT_TRUE(control.mute(true));
  const Status done = control.mute(false);
  ASSERT_TRUE(done) << done.error().what;
  EXPECT_EQ(projector.conversations().size(), 1U);
}

/// A peer that keeps us waiting costs the time limit and no more; loose, the times are real.
TEST_F(PjlinkConversation, WhoeverIsTooSlowIsNotWaitedFor) {
  limit_ = 100ms;
  const auto check = [&](FakeProjector::Behaviour behaviour) {
    FakeProjector projector(std::move(behaviour));
    Pjlink control = this->control(projector);
    const auto start = std::chrono::steady_clock::now();
    const Status done = control.mute(true);
    EXPECT_LT(std::chrono::steady_clock::now() - start, 2s);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, Errc::kTimeout);
    EXPECT_THAT(done.error().what, HasSubstr("time_limit_s"));
  };
  FakeProjector::Behaviour mute_greeting = class_1();
  mute_greeting.greeting = "";
  check(mute_greeting);
  FakeProjector::Behaviour half_greeting = class_1();
  half_greeting.greeting = "PJLI";
  check(half_greeting);
  FakeProjector::Behaviour late = class_1();
  late.delay = 300ms;
  check(late);
  FakeProjector::Behaviour silent = class_1();
  silent.replies["%1AVMT 11\r"] = "...";
  check(silent);
  FakeProjector::Behaviour half_reply = class_1();
  half_reply.replies["%1AVMT 11\r"] = "%1AVMT=O";
  check(half_reply);
  FakeProjector::Behaviour drip = class_1();  // something comes always, but never enough
  drip.greeting = std::string(400, 'x');
  drip.byte_delay = 2ms;
  check(drip);
}

TEST_F(PjlinkConversation, OneThatGreetsLateButInTimeIsUnderstood) {
  FakeProjector::Behaviour late = class_1();
  late.delay = 100ms;
  FakeProjector projector(late);
  EXPECT_TRUE(this->control(projector).mute(true));
}

TEST_F(PjlinkConversation, AnAnswerThatComesTooLateIsNotTakenForTheNext) {
  limit_ = 100ms;
  FakeProjector projector(class_1());
  Pjlink control = this->control(projector);
  ASSERT_TRUE(control.mute(true));
  projector.reply("%1AVMT 10\r", "...");
  EXPECT_EQ(control.mute(false).error().code, Errc::kTimeout);
  projector.reply("%1AVMT 10\r", "%1AVMT=ERR3\r");
  EXPECT_EQ(control.mute(false).error().code, Errc::kUnavailable);
  // Two replies to one request: the second is thrown away with its connection.
  projector.reply("%1AVMT 11\r", "%1AVMT=OK\r%1AVMT=ERR4\r");
  EXPECT_TRUE(control.mute(true));
  EXPECT_TRUE(control.power(true));
}

TEST_F(PjlinkConversation, GarbageIsRefusedAndTheNextCallBeginsAfresh) {
  FakeProjector projector(class_1());
  Pjlink control = this->control(projector);
  for (const std::string& garbage : {std::string("\r"),
                                     std::string("%1POWR=OK\r"),
                                     std::string("%1AVMT=\r"),
                                     std::string("%1AVMT=1\r"),
                                     std::string("\xff\x00\xfe\r", 4),
                                     std::string("PJLINK 0\r"),
                                     std::string(5000, 'x')}) {
    projector.reply("%1AVMT 11\r", garbage);
    const Status done = control.mute(true);
    ASSERT_FALSE(done) << garbage;
    EXPECT_EQ(done.error().code, Errc::kBadFormat) << done.error().what;
    EXPECT_TRUE(control.mute(false));
  }
  for (const std::string& greeting :
       {std::string("SSH-2.0-OpenSSH_9.2\r\n"), std::string(5000, 'y'), std::string("\r")}) {
    FakeProjector::Behaviour other = class_1();
    other.greeting = greeting;
    FakeProjector stranger(other);
    EXPECT_EQ(this->control(stranger).mute(true).error().code, Errc::kBadFormat) << greeting;
  }
}

TEST_F(PjlinkConversation, ValuesThatMakeNoSenseAreRefused) {
  for (const auto& [request, reply] : {std::pair{"%1POWR ?\r", "%1POWR=7\r"},
                                       std::pair{"%1INPT ?\r", "%1INPT=HDMI\r"},
                                       std::pair{"%1AVMT ?\r", "%1AVMT=99\r"},
                                       std::pair{"%1ERST ?\r", "%1ERST=00000\r"},
                                       std::pair{"%1LAMP ?\r", "%1LAMP=many\r"}}) {
    FakeProjector projector(class_1());
    projector.reply(request, reply);
    const auto state = this->control(projector).read_state();
    ASSERT_FALSE(state) << reply;
    EXPECT_EQ(state.error().code, Errc::kBadFormat) << reply;
  }
}

TEST_F(PjlinkConversation, OneThatGoesOnWithoutAnAnswerIsSeenToGoOn) {
  limit_ = 100ms;
  FakeProjector projector(class_1());
  projector.reply("%1POWR 1\r", "...");
  projector.reply("%1POWR ?\r", "%1POWR=3\r");
  const Status done = this->control(projector).power(true);
  EXPECT_TRUE(done) << done.error().what;
  EXPECT_THAT(projector.conversations(), ElementsAre("%1POWR 1\r", "%1POWR ?\r"));
}

TEST_F(PjlinkConversation, OneThatStaysOffWithoutAnAnswerIsReported) {
  limit_ = 50ms;
  FakeProjector projector(class_1());
  projector.reply("%1POWR 1\r", "...");
  projector.reply("%1POWR ?\r", "%1POWR=0\r");
  const Time start = clock_.now();
  const Status done = this->control(projector).power(true);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::kTimeout);
  EXPECT_THAT(done.error().what, HasSubstr("standby"));
  EXPECT_EQ(clock_.now() - start, 10s);  // five questions, 2 s apart
}

TEST_F(PjlinkConversation, ThoseThatMutePictureAndSoundTogetherAreMutedToo) {
  FakeProjector projector(class_1());
  projector.reply("%1AVMT 11\r", "%1AVMT=ERR2\r");
  projector.reply("%1AVMT 31\r", "%1AVMT=OK\r");
  EXPECT_TRUE(this->control(projector).mute(true));
  EXPECT_THAT(projector.conversations(), ElementsAre("%1AVMT 11\r%1AVMT 31\r"));
}

TEST_F(PjlinkConversation, Class1HasNoFreezeAndSaysSo) {
  FakeProjector projector(class_1());
  const Status done = this->control(projector).freeze(true);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::kUnavailable);
  EXPECT_THAT(projector.conversations(), ElementsAre("%1CLSS ?\r"));
}

TEST_F(PjlinkConversation, InterruptEndsTheCallUnderWayAndEveryLaterOne) {
  FakeProjector::Behaviour silent = class_1();
  silent.replies["%1AVMT 11\r"] = "...";
  FakeProjector projector(silent);
  limit_ = 60s;
  Pjlink control = this->control(projector);
  std::thread other([&] {
    while (projector.conversations().empty() || projector.conversations().back().empty())
      std::this_thread::sleep_for(1ms);
    control.interrupt();
  });
  const auto start = std::chrono::steady_clock::now();
  const Status done = control.mute(true);
  other.join();
  EXPECT_LT(std::chrono::steady_clock::now() - start, 5s);  // far below the time limit
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::kCancelled);
  EXPECT_EQ(control.mute(false).error().code, Errc::kCancelled);
  EXPECT_EQ(control.read_state().error().code, Errc::kCancelled);
}

TEST_F(PjlinkConversation, NobodyThereIsNotFoundWithARemedy) {
  int port = 0;
  {
    const FakeProjector gone(class_1());
    port = gone.port();
  }
  PjlinkOptions options;
  options.host = "127.0.0.1";
  options.port = port;
  Pjlink control(options, clock_);
  const auto state = control.read_state();
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().code, Errc::kNotFound);
  EXPECT_THAT(state.error().what, HasSubstr("switch PJLink"));
}

}  // namespace
}  // namespace veneer::projector
