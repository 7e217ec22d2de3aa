// SPDX-License-Identifier: Apache-2.0
// The projector's state as the daemon watches it: table [control], thread and faults together.
#include <gtest/gtest.h>

#include "daemon/testing/fake_projector.h"
#include "daemon/testing/real_time_fixture.h"
#include "render/internal_testing.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using testing::wait_until;

class ProjectorAlarmTest : public testing::RealTimeFixture {
 protected:
  void SetUp() override {
    RealTimeFixture::SetUp();
    machine_.state.power = projector::Power::kOn;
    machine_.state.input = "digital1";
  }
  void TearDown() override {
    RealTimeFixture::TearDown();
    publish("profile", {});
  }
  static void publish(const std::string& name, const projector::ControlRecord& record) {
    calibration::ProjectorProfile profile = render::example_profile(8, 6, 8);
    profile.record = record;
    ASSERT_TRUE(calibration::ProfileStore(at(name)).publish(profile));
  }
  Devices with_control() {
    Devices all = devices();
    all.open_control = [this](Clock&) -> Result<std::unique_ptr<projector::ProjectorControl>> {
      if (!machine_.there) return fail(Errc::kNotFound, "nobody answers");
      return std::make_unique<testing::FakeControl>(machine_);
    };
    return all;
  }
  [[nodiscard]] bool has(FaultKind kind) const {
    for (const service::Fault& fault : daemon_->status().faults)
      if (fault.kind == kind) return true;
    return false;
  }
  /// One that was measured with another input.
  void start_with_an_alarm() {
    publish("profile", {{"projector.input", "video2"}});
    start_with(with_control());
    ASSERT_TRUE(wait_until([this] { return has(FaultKind::kProjectorState); }));
  }
  [[nodiscard]] bool no_alarm_soon() const {
    return wait_until([this] { return !has(FaultKind::kProjectorState); });
  }

  testing::Machine machine_;
};

TEST_F(ProjectorAlarmTest, EndsWithTheProfileThatIsMeasuredAnew) {
  start_with_an_alarm();
  publish("profile", to_record(machine_.state));
  EXPECT_TRUE(no_alarm_soon()) << "its watcher exchanged it, and no show is over";
  EXPECT_EQ(machine_.opened, 1) << "without another question";
  end();
}

TEST_F(ProjectorAlarmTest, EndsWithAReloadThatNamesAnotherProfile) {
  publish("other", to_record(machine_.state));
  start_with_an_alarm();
  std::string config = read_text(at("veneer.toml")).value();
  config.replace(config.find("\"profile\""), 9, "\"other\"");
  ASSERT_TRUE(write_text(at("veneer.toml"), config));
  const Status reloaded = daemon_->reload();
  ASSERT_TRUE(reloaded) << reloaded.error().what;
  EXPECT_TRUE(no_alarm_soon());
  // And what becomes of that one later is noticed too.
  publish("other", {{"projector.input", "video2"}});
  EXPECT_TRUE(wait_until([this] { return has(FaultKind::kProjectorState); }));
  end();
}

TEST_F(ProjectorAlarmTest, IsAskedAsOftenAsTheConfigurationSays) {
  write_config("[control]\npoll_s = 1\n");
  start_with(with_control());
  EXPECT_TRUE(wait_until([this] { return machine_.opened >= 3; })) << "by default in a minute";
  EXPECT_NE(daemon_->status().projector.find("a machine: on, input digital1"), std::string::npos)
      << daemon_->status().projector;
  end();
}

TEST_F(ProjectorAlarmTest, SilenceIsAFaultAndThePictureGoesOn) {
  machine_.there = false;
  start_with(with_control());
  EXPECT_TRUE(wait_until([this] { return has(FaultKind::kProjector); }));
  EXPECT_NE(daemon_->status().projector.find("nobody answers"), std::string::npos);
  const std::uint64_t presented = hand_.presented;
  EXPECT_TRUE(wait_until([&] { return hand_.presented > presented + 10; }));
  end();
}

TEST_F(ProjectorAlarmTest, ItIsOpenedAsTheTableSays) {
  // Nobody listens there.
  write_config("[control]\ndriver = \"pjlink\"\nhost = \"127.0.0.1\"\nport = 1\n");
  start();
  EXPECT_TRUE(wait_until([this] { return has(FaultKind::kProjector); }));
  EXPECT_NE(daemon_->status().projector.find("127.0.0.1"), std::string::npos)
      << daemon_->status().projector;
  end();
}

TEST_F(ProjectorAlarmTest, NobodyIsAskedWhereThereIsNoTable) {
  start();
  EXPECT_EQ(daemon_->status().projector, "");
  EXPECT_FALSE(has(FaultKind::kProjector));
  end();
}

TEST_F(ProjectorAlarmTest, NobodyIsAskedInVirtualTime) {
  auto daemon =
      Daemon::create(at("veneer.toml"), {"clock=\"virtual\"", "frames=200"}, with_control())
          .value();
  SilentProgress silent;
  EXPECT_TRUE(daemon->run(stop_, silent));
  EXPECT_EQ(machine_.opened, 0);
  EXPECT_EQ(daemon->status().projector, "");
}

}  // namespace
}  // namespace veneer::daemon
