// SPDX-License-Identifier: Apache-2.0
// veneer projector, and what veneer verify says of a projector, against one on the loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <string>
#include <vector>

#include "calibration/exchange/cgats.h"
#include "calibration/profile.h"
#include "calibration/verification.h"
#include "projector/control/pjlink/fake_projector.h"
#include "tests/program.h"

namespace veneer {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using projector::pjlink::FakeProjector;
using testing::ElementsAre;
using testing::HasSubstr;

struct Command {
  const char* words;
  const char* request;  // without its CR
};
constexpr std::array kCommands{Command{"on", "%1POWR 1"},
                               Command{"off", "%1POWR 0"},
                               Command{"blank", "%1AVMT 11"},
                               Command{"unblank", "%1AVMT 10"},
                               Command{"freeze", "%2FREZ 1"},
                               Command{"unfreeze", "%2FREZ 0"},
                               Command{"input digital2", "%2INPT 32"}};

std::string head_of(const std::string& request) { return request.substr(0, 6) + "="; }

class ProjectorProgram : public testing::Test {
 protected:
  Outcome projector(const FakeProjector& fake, const std::string& words) {
    return run(fmt::format("veneer projector --driver pjlink --host 127.0.0.1 --port {} --json {}",
                           fake.port(),
                           words));
  }
  std::string at(const std::string& name) const { return (folder_.path() / name).string(); }
  TemporaryFolder folder_;
};

TEST_F(ProjectorProgram, SaysHowTheProjectorIs) {
  FakeProjector::Behaviour behaviour = FakeProjector::well();
  behaviour.greeting = "PJLINK 1 498e4a67\r";
  FakeProjector fake(behaviour);
  ASSERT_TRUE(write_text(at("password"), "JBMIAProjectorLink\n"));
  const Outcome outcome = projector(fake, "--password-file " + at("password") + " status");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json state = json::parse(outcome.out, nullptr, false);
  ASSERT_TRUE(state.is_object()) << outcome.out;
  EXPECT_EQ(state["power"], "on");
  EXPECT_EQ(state["input"], "digital1");
  EXPECT_EQ(state["muted"], false);
  EXPECT_EQ(state["frozen"], false);
  EXPECT_EQ(state["lamps"], json::parse(R"([{"hours": 1234, "on": true}])"));
  EXPECT_EQ(state["health"]["fan"], "ok");
  EXPECT_EQ(state["serial"], "S123");
  EXPECT_TRUE(state["warnings"].empty());
  EXPECT_THAT(fake.conversations(),
              ElementsAre("5d8409bc1c3fa39749434aa3a5c38682%1CLSS ?\r%1POWR ?\r%2INPT ?\r"
                          "%1AVMT ?\r%1ERST ?\r%1LAMP ?\r%1INF1 ?\r%1INF2 ?\r%1NAME ?\r"
                          "%2FREZ ?\r%2IRES ?\r%2RRES ?\r%2INNM ?31\r%2SNUM ?\r%2SVER ?\r"));
}

TEST_F(ProjectorProgram, EveryCommandIsSaidAsLaidDown) {
  for (const Command& command : kCommands) {
    const std::string request = std::string(command.request) + "\r";
    FakeProjector fake(FakeProjector::well());
    fake.reply(request, head_of(request) + "OK\r");
    const Outcome done = projector(fake, command.words);
    ASSERT_EQ(done.exit_code, 0) << command.words << done.err;
    EXPECT_TRUE(json::parse(done.out, nullptr, false).is_object()) << done.out;
    EXPECT_THAT(fake.conversations().back(), testing::EndsWith(request));
  }
}

// Of one command; all of them are refused in the driver's own tests.
TEST_F(ProjectorProgram, ARefusalIsExplainedAndHasItsExitCode) {
  struct Refusal {
    const char* reply;
    int exit_code;
    const char* text;
  };
  FakeProjector fake(FakeProjector::well());
  for (const Refusal& refusal : {Refusal{"%2INPT=ERR1\r", 1, "does not know"},
                                 Refusal{"%2INPT=ERR2\r", 2, "does not take"},
                                 Refusal{"%2INPT=ERR3\r", 1, "at present"},
                                 Refusal{"%2INPT=ERR4\r", 1, "has failed"},
                                 Refusal{"PJLINK ERRA\r", 2, "password"},
                                 Refusal{"", 1, "hung up"}}) {
    fake.reply("%2INPT 32\r", refusal.reply);
    EXPECT_TRUE(fails(projector(fake, "input digital2"), refusal.exit_code, refusal.text))
        << refusal.reply;
  }
}

TEST_F(ProjectorProgram, WrongUsageAndNobodyThereAreTold) {
  FakeProjector fake(FakeProjector::well());
  EXPECT_TRUE(fails(projector(fake, "input hdmi"), 2, "digital1"));
  EXPECT_TRUE(fails(projector(fake, "degamma-off"), 1, "own menu"));
  EXPECT_TRUE(fails(run("veneer projector status"), 2, "[control]"));
  EXPECT_TRUE(fails(run("veneer projector"), 2, "say what to do: status, search, on, off, "));
  EXPECT_TRUE(fails(run("veneer projector dance"), 2, "there is no \"dance\""));
  EXPECT_TRUE(fails(run("veneer projector --driver rs232 status"), 2, "pjlink"));
  EXPECT_TRUE(fails(projector(fake, "--password-file /dev/zero status"), 1, "first line"));
  int port = 0;
  {
    const FakeProjector gone(FakeProjector::well());
    port = gone.port();
  }
  EXPECT_TRUE(fails(
      run(fmt::format("veneer projector --driver pjlink --host 127.0.0.1 --port {} status", port)),
      1,
      "nobody listens"));
}

TEST_F(ProjectorProgram, TakesTheTableThatTheDaemonHas) {
  FakeProjector fake(FakeProjector::well());
  ASSERT_TRUE(write_text(at("veneer.toml"),
                         fmt::format("scene = \"s\"\n[control]\ndriver = \"pjlink\"\n"
                                     "host = \"127.0.0.1\"\nport = {}\npoll_s = 30\n",
                                     fake.port())));
  const Outcome outcome = run("veneer projector --config " + at("veneer.toml") + " status");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("digital1"));
  EXPECT_THAT(outcome.out, HasSubstr("lamp_hours"));
}

// A profile whose predictions are the readings, so that only the projector's state is in question.
class VerifyOnARig : public ProjectorProgram {
 protected:
  VerifyOnARig() : fake_(FakeProjector::well()) {
    calibration::ProjectorProfile profile;
    profile.geometry = {64, 48, 80, 80, 32, 24, {}};
    for (auto& curve : profile.tone_curves)
      for (int code = 0; code < 256; ++code) curve.push_back(code / 255.0);
    profile.primaries << 41, 36, 18, 21, 72, 7, 2, 12, 95;
    profile.black = {0.1, 0.1, 0.1};
    profile.vignetting = Image<float>(1, 1, 1.0F);
    profile.record = {{"projector.input", "digital1"},
                      {"projector.power", "on"},
                      {"projector.lamp_hours", "1234"}};
    EXPECT_TRUE(profile.save(folder_.path() / "profile"));
    calibration::MeasuredPatches readings;
    const auto add = [&](const std::array<std::uint16_t, 3>& code) {
      const Eigen::Vector3d drive(code[0] / 255.0, code[1] / 255.0, code[2] / 255.0);
      readings.patches.push_back(
          {drive, profile.emitted(profile.linear_drive(code)) + profile.black});
    };
    for (const auto& patch : calibration::verification_patches(profile, kPatches, 2, false))
      add(patch.code);
    for (const auto& code : std::vector<std::array<std::uint16_t, 3>>{
             {0, 0, 0}, {255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}})
      add(code);
    EXPECT_TRUE(calibration::write_ti3(folder_.path() / "readings.ti3", readings));
    EXPECT_TRUE(write_text(
        at("rig.toml"),
        fmt::format("raster = [64, 48]\nreference_distance_m = 1.0\n[output]\ndriver = \"null\"\n"
                    "[instrument]\ndriver = \"file\"\nwhite_reference = \"readings.ti3\"\n"
                    "object = \"readings.ti3\"\n[board]\ncolumns = 9\nrows = 7\nsquare_mm = 25\n"
                    "[control]\ndriver = \"pjlink\"\nhost = \"127.0.0.1\"\nport = {}\n"
                    "time_limit_s = 0.5\npoll_s = 30\n",
                    fake_.port())));
  }
  /// A person who says "done" whenever asked to point the instrument.
  Outcome verify(const std::string& more = "") {
    const std::string line = fmt::format(
        "printf \"\\n\\n\\n\\n\\n\\n\" | {}/veneer verify {} --patches {} --repeats 1 "
        "--rig {} --profile {} >{} 2>{}",
        VENEER_PROGRAMS,
        more,
        kPatches,
        at("rig.toml"),
        at("profile"),
        at("out"),
        at("err"));
    const int status = std::system(line.c_str());
    return {WEXITSTATUS(status), *read_text(at("out")), *read_text(at("err"))};
  }
  /// On the white board and on the object; each is shown for the 0.4 s that an output settles in.
  static constexpr int kPatches = 2;
  FakeProjector fake_;
};

TEST_F(VerifyOnARig, AProjectorAsItWasIsNoCauseForWords) {
  const Outcome outcome = verify("--json");
  const json result = json::parse(outcome.out, nullptr, false);
  ASSERT_TRUE(result.is_object()) << outcome.out << outcome.err;
  EXPECT_EQ(result["good"], true) << outcome.out;
  EXPECT_EQ(result["projector"]["reachable"], true);
  EXPECT_TRUE(result["projector"]["changes"].empty());
  EXPECT_TRUE(result["projector"]["warnings"].empty());
  EXPECT_EQ(outcome.err.find("Warning"), std::string::npos) << outcome.err;
}

TEST_F(VerifyOnARig, WhatChangedIsSaidBeforeAnythingElse) {
  fake_.reply("%2INPT ?\r", "%2INPT=32\r");
  fake_.reply("%1LAMP ?\r", "%1LAMP=3 1\r");
  fake_.reply("%2FREZ ?\r", "%2FREZ=1\r");
  const Outcome outcome = verify();
  EXPECT_THAT(outcome.out, testing::StartsWith("Warning: the projector is not as it was"));
  EXPECT_THAT(outcome.out, HasSubstr("digital2"));
  EXPECT_THAT(outcome.out, HasSubstr("replaced"));
  EXPECT_THAT(outcome.out, HasSubstr("frozen"));
  // And before the first reading is asked for.
  EXPECT_LT(outcome.err.find("digital2"), outcome.err.find("Point the instrument"));
  const json result = json::parse(verify("--json").out, nullptr, false);
  EXPECT_EQ(result["projector"]["changes"].size(), 2U);
  EXPECT_EQ(result["projector"]["warnings"].size(), 1U);
}

TEST_F(VerifyOnARig, AProjectorThatCannotBeAskedIsAWarningToo) {
  fake_.greet("");
  const Outcome outcome = verify("--json");
  const json result = json::parse(outcome.out, nullptr, false);
  ASSERT_TRUE(result.is_object()) << outcome.out << outcome.err;
  EXPECT_EQ(result["projector"]["reachable"], false);
  EXPECT_THAT(outcome.err, HasSubstr("cannot be asked"));
  EXPECT_EQ(result["good"], true);
}

}  // namespace
}  // namespace veneer
