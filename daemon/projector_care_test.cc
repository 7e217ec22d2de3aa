// SPDX-License-Identifier: Apache-2.0
#include "daemon/projector_care.h"

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "base/testing/temporary_folder.h"
#include "calibration/profile_store.h"
#include "render/internal_testing.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;

/// A projector that says what it is told to say.
struct Machine {
  std::mutex mutex;
  projector::ProjectorState state;
  std::atomic<bool> there{true};
  void set(const std::function<void(projector::ProjectorState&)>& edit) {
    const std::scoped_lock lock(mutex);
    edit(state);
  }
};

class Control final : public projector::ProjectorControl {
 public:
  explicit Control(Machine& machine) : machine_(machine) {}
  std::string description() const override { return "a machine"; }
  Result<projector::ProjectorState> read_state() override {
    const std::scoped_lock lock(machine_.mutex);
    return machine_.state;
  }
  Status power(bool) override { return {}; }
  Status mute(bool) override { return {}; }
  Status freeze(bool) override { return {}; }
  Status select_input(const std::string&) override { return {}; }

 private:
  Machine& machine_;
};

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
          return std::make_unique<Control>(machine_);
        },
        kept,
        folder_.path() / "profile",
        quick,
        faults_,
        clock_);
  }
  /// Looks until it is so; false after five seconds.
  bool comes_to(ProjectorCare& care, const std::function<bool()>& so, std::uint64_t profiles = 0) {
    for (int i = 0; i < 1000; ++i) {
      care.look(profiles);
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
  watched->look(0);
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
  ASSERT_TRUE(comes_to(*watched, [this] { return has(FaultKind::kProjectorState); }));
  calibration::ProjectorProfile profile = render::example_profile(8, 6, 8);
  profile.record = to_record(machine_.state);
  ASSERT_TRUE(calibration::ProfileStore(folder_.path() / "profile").publish(profile));
  EXPECT_TRUE(comes_to(
      *watched, [this] { return !has(FaultKind::kProjectorState); }, 1));
}

}  // namespace
}  // namespace veneer::daemon
