// SPDX-License-Identifier: Apache-2.0
#include "daemon/projector_care.h"

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "base/testing/temporary_folder.h"
#include "calibration/profile_store.h"
#include "daemon/testing/fake_projector.h"
#include "render/internal_testing.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;

using testing::FakeControl;
using testing::Machine;

class ProjectorCareTest : public ::testing::Test {
 protected:
  ProjectorCareTest() {
    machine_.state.power = projector::Power::kOn;
    machine_.state.input = "digital1";
  }
  std::unique_ptr<ProjectorCare> care(const projector::ControlRecord& kept) {
    const projector::ControlWatchOptions quick{
        .period = 5ms, .first_pause = 5ms, .longest_pause = 10ms};
    return std::make_unique<ProjectorCare>(
        [this]() -> Result<std::unique_ptr<projector::ProjectorControl>> {
          if (!machine_.there) return fail(Errc::kNotFound, "nobody answers");
          return std::make_unique<FakeControl>(machine_);
        },
        kept,
        folder_.path() / "profile",
        quick,
        faults_,
        clock_);
  }
  /// Looks until it is so; false after five seconds.
  bool comes_to(ProjectorCare& care,
                const std::function<bool()>& so,
                std::uint64_t changes = 0,
                const std::string& profile = "profile") {
    for (int i = 0; i < 1000; ++i) {
      care.look(folder_.path() / profile, changes);
      if (so()) return true;
      std::this_thread::sleep_for(5ms);
    }
    return false;
  }
  bool has(FaultKind kind) const { return faults_.has(kind); }

  TemporaryFolder folder_;
  Machine machine_;
  SteadyClock clock_;
  Faults faults_;
};

TEST_F(ProjectorCareTest, SilenceIsAFaultUntilItAnswers) {
  machine_.there = false;
  const auto watched = care(to_record(machine_.state));
  ASSERT_TRUE(comes_to(*watched, [this] { return has(FaultKind::kProjector); }));
  EXPECT_NE(watched->text().find("nobody answers"), std::string::npos) << watched->text();
  EXPECT_FALSE(has(FaultKind::kProjectorState)) << "nothing is known of its state";
  machine_.there = true;
  ASSERT_TRUE(comes_to(*watched, [this] { return !has(FaultKind::kProjector); }));
  EXPECT_FALSE(has(FaultKind::kProjectorState));
  EXPECT_NE(watched->text().find("digital1"), std::string::npos) << watched->text();
}

TEST_F(ProjectorCareTest, WhatIsNotAsItWasIsAnAlarmUntilItIsSetBack) {
  const auto watched = care(to_record(machine_.state));
  machine_.set([](auto& state) { state.input = "video2"; });
  ASSERT_TRUE(comes_to(*watched, [this] { return has(FaultKind::kProjectorState); }));
  EXPECT_NE(faults_.list().front().text.find("video2"), std::string::npos);
  machine_.set([](auto& state) { state.input = "digital1"; });
  EXPECT_TRUE(comes_to(*watched, [this] { return !has(FaultKind::kProjectorState); }));
}

TEST_F(ProjectorCareTest, WhatTheProfileWasMeasuredWithIsNoAlarm) {
  machine_.state.degamma = true;
  machine_.state.health["filter"] = projector::Health::kWarning;
  const auto watched = care(to_record(machine_.state));
  const std::function<bool()> seen = [&] {
    return watched->text().find("filter warning") != std::string::npos;
  };
  ASSERT_TRUE(comes_to(*watched, seen));
  watched->look(folder_.path() / "profile", 0);
  EXPECT_FALSE(has(FaultKind::kProjectorState)) << faults_.list().front().text;
}

TEST_F(ProjectorCareTest, WhatIsWrongNowIsNotSaidToHaveChanged) {
  const auto watched = care(to_record(machine_.state));
  machine_.set([](auto& state) { state.health["fan"] = projector::Health::kWarning; });
  ASSERT_TRUE(comes_to(*watched, [this] { return has(FaultKind::kProjectorState); }));
  const std::string text = faults_.list().front().text;
  EXPECT_NE(text.find("fan warning"), std::string::npos) << text;
  EXPECT_EQ(text.find("since the profile"), std::string::npos) << text;
  EXPECT_EQ(text.find("set it back"), std::string::npos) << text;
}

TEST_F(ProjectorCareTest, AnAlarmOutlivesSilence) {
  const auto watched = care(to_record(machine_.state));
  machine_.set([](auto& state) { state.muted = true; });
  ASSERT_TRUE(comes_to(*watched, [this] { return has(FaultKind::kProjectorState); }));
  machine_.there = false;
  ASSERT_TRUE(comes_to(*watched, [this] { return has(FaultKind::kProjector); }));
  EXPECT_TRUE(has(FaultKind::kProjectorState)) << "nobody said that it was set back";
}

TEST_F(ProjectorCareTest, ANewProfileIsWhatItIsComparedWith) {
  const auto watched = care({{"projector.input", "video2"}});
  const auto alarm = [this] { return has(FaultKind::kProjectorState); };
  const auto no_alarm = [this] { return !has(FaultKind::kProjectorState); };
  const auto publish = [this](const std::string& profile, const projector::ControlRecord& record) {
    calibration::ProjectorProfile made = render::example_profile(8, 6, 8);
    made.record = record;
    ASSERT_TRUE(calibration::ProfileStore(folder_.path() / profile).publish(made));
  };
  ASSERT_TRUE(comes_to(*watched, alarm));
  publish("profile", to_record(machine_.state));
  EXPECT_TRUE(comes_to(*watched, no_alarm, 1));
  publish("other", {{"projector.input", "video2"}});
  EXPECT_TRUE(comes_to(*watched, alarm, 1, "other")) << "it is in another folder";
  publish("other", to_record(machine_.state));
  watched->look(folder_.path() / "other", 1);
  EXPECT_TRUE(alarm()) << "nothing is read that is not drawn with";
  EXPECT_TRUE(comes_to(*watched, no_alarm, 2, "other"));
}

}  // namespace
}  // namespace veneer::daemon
