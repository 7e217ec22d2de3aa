// SPDX-License-Identifier: Apache-2.0
// The wizard beside a projector that can be asked, on a virtual bench and over the loopback.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "calibration/profile.h"
#include "calibration/wizard/wizard.h"
#include "cli/calibrate/bench_devices.h"
#include "projector/control/pjlink/fake_projector.h"
#include "projector/control/pjlink/pjlink.h"

namespace veneer {
namespace {

using calibration::Answer;
using calibration::ProjectorProfile;
using calibration::Task;
using calibration::WizardOutcome;
using projector::pjlink::FakeProjector;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Does as it is told: answers what the test says to the question about the projector, stops at a
/// failure.
class ScriptedOperator final : public calibration::Operator {
 public:
  Answer to_doubts = Answer::kDone;
  std::vector<std::string> doubts;
  std::vector<std::string> failures;
  Answer to_failure = Answer::kQuit;  // the first time; then it stops
  std::function<void()> at_failure;

  [[nodiscard]] Result<Answer> please(const calibration::Request& request) override {
    if (request.task != Task::kSeeToProjector) return Answer::kDone;
    doubts.push_back(request.text);
    return to_doubts;
  }
  [[nodiscard]] Result<Answer> after_failure(std::string_view, const Error& why) override {
    failures.push_back(why.what);
    if (at_failure) at_failure();
    return std::exchange(to_failure, Answer::kQuit);
  }
  void say(std::string_view) override {}
};

class WizardControl : public testing::Test {
 protected:
  WizardControl() : fake_(FakeProjector::well()) {
    options_.host = "127.0.0.1";
    options_.port = fake_.port();
    options_.time_limit = std::chrono::seconds(2);
    options_.shortest_period = Duration{0};  // what the test changes is seen at once
    control_ = std::make_unique<projector::Pjlink>(options_, clock_);
  }

  /// Only the steps that a profile cannot do without, and those that are looked at here, of as few
  /// patches as make a profile. The geometry is taken over: no picture of a camera is drawn.
  Result<WizardOutcome> calibrate(std::set<std::string> skip = {"warm-up", "object", "verify"}) {
    auto bench = cli::BenchDevices::open(VENEER_ETC "/benches/plain-lcd.toml", operator_);
    if (!bench) return tl::unexpected<Error>(bench.error());
    calibration::WizardOptions options;
    (*bench)->fill(options);
    options.profile = profile();
    options.session = folder_.path() / "session";
    options.skip = std::move(skip);
    options.radiometry.levels = 6;
    options.radiometry.repeats = 1;
    options.radiometry.held_out = 8;
    options.radiometry.vignetting_columns = 3;
    options.radiometry.vignetting_rows = 3;
    const simulation::ProjectorTruth& truth = (*bench)->bench().truth().projector;
    options.known_geometry = {truth.width,
                              truth.height,
                              truth.focal_px.x(),
                              truth.focal_px.y(),
                              truth.principal_point.x(),
                              truth.principal_point.y(),
                              truth.world_from_projector};
    calibration::Devices devices = (*bench)->devices();
    devices.camera = nullptr;
    devices.control = control_.get();
    int steps = 0;
    devices.begin_step = [&, before = devices.begin_step] {
      if (before) before();
      if (++steps == change_at_) change_();
    };
    SilentProgress progress;
    return run_wizard(options, devices, progress);
  }
  std::filesystem::path profile() const { return folder_.path() / "profile"; }

  static const std::set<std::string>& all_but_the_projector() {
    static const std::set<std::string> kSkip{
        "picture", "warm-up", "room", "geometry", "object", "light", "verify", "publish"};
    return kSkip;
  }

  TemporaryFolder folder_;
  SteadyClock clock_;
  FakeProjector fake_;
  projector::PjlinkOptions options_;
  std::unique_ptr<projector::ProjectorControl> control_;
  ScriptedOperator operator_;
  int change_at_ = 0;  // before the step of this number
  std::function<void()> change_;
};

TEST_F(WizardControl, TheStateIsKeptWithTheProfile) {
  const auto outcome = calibrate();
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_TRUE(outcome->finished);
  auto made = ProjectorProfile::load(profile());
  ASSERT_TRUE(made) << made.error().what;
  const auto state = control_->read_state();
  ASSERT_TRUE(state);
  for (const auto& entry : projector::to_record(*state)) EXPECT_THAT(made->record, Contains(entry));
  EXPECT_EQ(made->record.at("projector.lamp_hours"), "1234");
  EXPECT_EQ(made->record["warnings"].find("projector"), std::string::npos);
  EXPECT_THAT(operator_.doubts, IsEmpty());
  // What the daemon does with it later.
  EXPECT_THAT(projector::differences(made->record, projector::to_record(*state)), IsEmpty());
  projector::ProjectorState other = *state;
  other.input = "digital2";
  EXPECT_THAT(projector::differences(made->record, projector::to_record(other)),
              testing::ElementsAre(HasSubstr("digital2")));
}

TEST_F(WizardControl, WithoutAControlNothingIsAskedAndNothingKept) {
  control_.reset();
  const auto outcome = calibrate();
  ASSERT_TRUE(outcome) << outcome.error().what;
  EXPECT_TRUE(outcome->finished);
  const auto made = ProjectorProfile::load(profile());
  ASSERT_TRUE(made);
  for (const auto& [key, value] : made->record) EXPECT_FALSE(key.starts_with("projector.")) << key;
  EXPECT_THAT(fake_.conversations(), IsEmpty());
}

TEST_F(WizardControl, WhatCannotBeMeasuredIsAnErrorThatSaysWhatToDo) {
  struct Case {
    const char* request;
    const char* reply;
    const char* good;
    const char* remedy;
  };
  for (const Case& each : {Case{"%1POWR ?\r", "%1POWR=0\r", "%1POWR=1\r", "switch it on"},
                           Case{"%1POWR ?\r", "%1POWR=2\r", "%1POWR=1\r", "switch it on"},
                           Case{"%1POWR ?\r", "%1POWR=3\r", "%1POWR=1\r", "wait"},
                           Case{"%1AVMT ?\r", "%1AVMT=31\r", "%1AVMT=30\r", "unblank"},
                           Case{"%2FREZ ?\r", "%2FREZ=1\r", "%2FREZ=0\r", "unfreeze"}}) {
    fake_.reply(each.request, each.reply);
    const auto outcome = calibrate(all_but_the_projector());
    ASSERT_FALSE(outcome) << each.reply;
    EXPECT_THAT(outcome.error().what, HasSubstr(each.remedy));
    fake_.reply(each.request, each.good);
  }
  // Once it is seen to, the same step goes on.
  fake_.reply("%1POWR ?\r", "%1POWR=0\r");
  operator_.to_failure = Answer::kAgain;
  operator_.at_failure = [this] { fake_.reply("%1POWR ?\r", "%1POWR=1\r"); };
  EXPECT_TRUE(calibrate(all_but_the_projector()));
}

TEST_F(WizardControl, AProjectorThatDoesNotAnswerIsAnErrorAndCanBeLeftOut) {
  fake_.greet("");
  options_.time_limit = std::chrono::milliseconds(100);
  control_ = std::make_unique<projector::Pjlink>(options_, clock_);
  const auto outcome = calibrate(all_but_the_projector());
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, Errc::kTimeout);
  operator_.to_failure = Answer::kSkip;
  EXPECT_TRUE(calibrate(all_but_the_projector()));
}

TEST_F(WizardControl, WhatMaySpoilColoursIsAskedAbout) {
  fake_.reply("%1ERST ?\r", "%1ERST=001000\r");  // temperature, a warning
  ASSERT_TRUE(calibrate(all_but_the_projector()));
  EXPECT_THAT(operator_.doubts, testing::ElementsAre(HasSubstr("temperature")));
  operator_.to_doubts = Answer::kQuit;
  const auto stopped = calibrate(all_but_the_projector());
  ASSERT_TRUE(stopped);
  EXPECT_FALSE(stopped->finished);
}

TEST_F(WizardControl, AChangeMeanwhileLeavesTheProfileOfBeforeAlone) {
  ASSERT_TRUE(calibrate());
  std::filesystem::remove_all(folder_.path() / "session");
  const auto before = read_text(profile() / "profile.json");
  change_at_ = 5;  // while the light is measured
  change_ = [this] { fake_.reply("%2INPT ?\r", "%2INPT=32\r"); };
  const auto outcome = calibrate();
  ASSERT_FALSE(outcome);
  EXPECT_THAT(outcome.error().what, HasSubstr("changed while it was calibrated"));
  EXPECT_THAT(outcome.error().what, HasSubstr("digital2"));
  EXPECT_EQ(read_text(profile() / "profile.json").value(), before.value());

  // Nor does going on with the session make it right.
  change_at_ = 0;
  const auto resumed = calibrate();
  ASSERT_FALSE(resumed);
  EXPECT_THAT(resumed.error().what, HasSubstr("when this session was begun"));
  operator_.to_failure = Answer::kAgain;
  EXPECT_FALSE(calibrate());  // as often as one likes

  // Set back, there is a profile, and it says what happened.
  fake_.reply("%2INPT ?\r", "%2INPT=31\r");
  const auto good = calibrate();
  ASSERT_TRUE(good) << good.error().what;
  EXPECT_TRUE(good->finished);
  const auto made = ProjectorProfile::load(profile());
  ASSERT_TRUE(made);
  EXPECT_THAT(made->record.at("warnings"), HasSubstr("set back"));
  EXPECT_THAT(made->record.at("warnings"), HasSubstr("digital2"));
}

TEST_F(WizardControl, LeftOutAtTheEndTooItIsNotInTheRecord) {
  const auto outcome = calibrate({"projector", "warm-up", "object", "verify"});
  ASSERT_TRUE(outcome) << outcome.error().what;
  const auto made = ProjectorProfile::load(profile());
  ASSERT_TRUE(made);
  for (const auto& [key, value] : made->record) EXPECT_FALSE(key.starts_with("projector.")) << key;
  EXPECT_THAT(fake_.conversations(), IsEmpty());
}

}  // namespace
}  // namespace veneer
