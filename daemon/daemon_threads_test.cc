// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include "base/files.h"
#include "calibration/profile_store.h"
#include "daemon/testing/real_time_fixture.h"
#include "render/internal_testing.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using service::State;

using testing::wait_until;

class RealTimeDaemonTest : public testing::RealTimeFixture {};

TEST_F(RealTimeDaemonTest, CallsOfManyThreadsAreServedOneAfterAnother) {
  start();
  std::atomic<int> served{0};
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([&, caller] {
      for (int i = 0; i < 5; ++i) {
        Status status;
        switch ((caller + i) % 5) {
          case 0:
            status = daemon_->set_light(0, {{0, 0, 1}, 10.0 + i, {1, 1, 1}});
            break;
          case 1:
            status = daemon_->load_material(at("material.safetensors"));
            break;
          case 2:
            status = daemon_->reload();
            break;
          case 3:
            status = daemon_->snapshot().map([](const auto&) {});
            break;
          default:
            status = daemon_->set_scene(at("scene.toml"));
        }
        EXPECT_TRUE(status) << status.error().what;
        (void)daemon_->status();
        ++served;
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(served, 20);
  // On a busy machine frames are late.
  for (const service::Fault& fault : daemon_->status().faults)
    EXPECT_EQ(fault.kind, FaultKind::kLate) << fault.text;
  end();
}

TEST_F(RealTimeDaemonTest, RecoversFromALostGpuOnTheLoadersThread) {
  start();
  hand_.gpu_lost = true;
  EXPECT_TRUE(wait_until([&] { return daemon_->status().recovered == 1; }));
  EXPECT_EQ(hand_.renderers, 2);
  EXPECT_TRUE(wait_until([&] { return daemon_->status().state == State::kRunning; }));
  EXPECT_TRUE(wait_until([&] { return hand_.alive == 1; })) << "the old one was destroyed";
  end();
}

TEST_F(RealTimeDaemonTest, AReloadWhileThereIsNoGpuWaitsForNoFrame) {
  start();
  hand_.renderer_refuses = true;
  hand_.gpu_lost = true;
  ASSERT_TRUE(wait_until([&] { return daemon_->status().state == State::kBlank; }));
  const Status reloaded = daemon_->reload();
  EXPECT_TRUE(reloaded) << reloaded.error().what;
  hand_.renderer_refuses = false;
  EXPECT_TRUE(wait_until([&] { return daemon_->status().state == State::kRunning; }));
  end();
}

TEST_F(RealTimeDaemonTest, FramesThatTheDisplayRefusesDidNotGoOut) {
  start();
  hand_.output_away = true;
  ASSERT_TRUE(wait_until([&] { return daemon_->status().state == State::kFault; }));
  const std::uint64_t frames = daemon_->frames();
  const std::uint64_t turns = daemon_->turns();
  EXPECT_TRUE(wait_until([&] { return daemon_->turns() > turns + 300; }));
  EXPECT_EQ(daemon_->frames(), frames);
  EXPECT_EQ(daemon_->status().frames, frames);
  EXPECT_EQ(daemon_->status().frame_rate_hz, 0);
  hand_.output_away = false;
  EXPECT_TRUE(wait_until([&] { return daemon_->frames() > frames + 10; }));
  end();
}

TEST_F(RealTimeDaemonTest, BlankReturnsWhenItIsDark) {
  start();
  EXPECT_TRUE(daemon_->blank(true));
  EXPECT_TRUE(hand_.dark);
  const std::uint64_t frames = daemon_->frames();
  EXPECT_TRUE(wait_until([&] { return daemon_->frames() > frames + 10; }));
  EXPECT_TRUE(daemon_->blank(false));
  EXPECT_FALSE(hand_.dark);
  end();
}

TEST_F(RealTimeDaemonTest, BlankSaysSoWhereTheDisplayDoesNotGoDark) {
  start();
  hand_.output_stays_lit = true;
  const Status refused = daemon_->blank(true);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kTimeout);
  hand_.output_stays_lit = false;
  EXPECT_TRUE(wait_until([&] { return hand_.dark.load(); })) << "it is still asked for";
  end();
}

TEST_F(RealTimeDaemonTest, ACommandKeepsTheProfileThatCameSinceTheShowWasMade) {
  const calibration::ProfileStore store(at("profile"));
  calibration::ProjectorProfile profile = render::example_profile(8, 6, 8);
  const double before_m = profile.reference_distance_m;
  start();
  profile.reference_distance_m = 2 * before_m;
  ASSERT_TRUE(store.publish(profile));
  ASSERT_TRUE(wait_until([&] { return hand_.given_distance_m == 2 * before_m; }));
  EXPECT_TRUE(wait_until([&] {
    EXPECT_TRUE(daemon_->set_light(0, {{0, 0, 1}, 10.0, {1, 1, 1}}));
    return profile_distance_m_ == 2 * before_m;
  }));
  ASSERT_TRUE(write_text(at("profile") / "profile.json", "damaged"));
  EXPECT_TRUE(daemon_->set_light(0, {{0, 0, 1}, 20.0, {1, 1, 1}}));
  EXPECT_EQ(profile_distance_m_, 2 * before_m) << "though what lies there by now cannot be read";
  end();
  profile.reference_distance_m = before_m;
  ASSERT_TRUE(store.publish(profile));
}

/// With a runtime directory, as systemd gives one.
class DarkDaemonTest : public RealTimeDaemonTest {
 protected:
  void SetUp() override {
    RealTimeDaemonTest::SetUp();
    ::setenv("RUNTIME_DIRECTORY", runtime_.path().c_str(), 1);
  }
  void TearDown() override {
    RealTimeDaemonTest::TearDown();
    ::unsetenv("RUNTIME_DIRECTORY");
  }
  [[nodiscard]] bool remembered() const {
    return std::filesystem::exists(runtime_.path() / "dark");
  }
  /// One that was told to be dark and then died, not in good order.
  void die_in_the_dark() {
    const auto dead = Daemon::create(at("veneer.toml"), {}, devices()).value();
    EXPECT_TRUE(dead->blank(true));
    EXPECT_TRUE(remembered());
  }

  TemporaryFolder runtime_;
};

TEST_F(DarkDaemonTest, DarknessOutlivesADeathUntilItIsTakenBack) {
  die_in_the_dark();
  start();
  EXPECT_EQ(daemon_->status().state, State::kBlank);
  EXPECT_EQ(hand_.presented, 0U) << "not one frame";
  EXPECT_TRUE(hand_.dark);
  EXPECT_TRUE(daemon_->blank(false));
  EXPECT_FALSE(remembered());
  EXPECT_TRUE(wait_until([&] { return hand_.presented > 10; }));
  end();
}

TEST_F(DarkDaemonTest, DarknessEndsWithAStopInGoodOrder) {
  start();
  EXPECT_TRUE(daemon_->blank(true));
  EXPECT_TRUE(remembered());
  end();
  EXPECT_FALSE(remembered());
}

TEST_F(DarkDaemonTest, DarknessOutlivesAnEndThatFails) {
  write_config("summary = \"scene.toml/summary.json\"\n");
  start();
  EXPECT_TRUE(daemon_->blank(true));
  stop_ = true;
  EXPECT_FALSE(ran_.get());
  EXPECT_TRUE(remembered()) << "systemd starts another one";
}

TEST_F(DarkDaemonTest, DarknessOutlivesAStartThatFails) {
  die_in_the_dark();
  hand_.output_refuses = true;
  auto daemon = Daemon::create(at("veneer.toml"), {}, devices()).value();
  SilentProgress silent;
  EXPECT_FALSE(daemon->run(stop_, silent));
  EXPECT_TRUE(remembered()) << "systemd starts another one";
}

TEST_F(DarkDaemonTest, ItIsDarkEvenWhereThatCannotBeRemembered) {
  ::setenv("RUNTIME_DIRECTORY", (runtime_.path() / "gone").c_str(), 1);
  start();
  EXPECT_TRUE(daemon_->blank(true));
  EXPECT_TRUE(hand_.dark);
  EXPECT_TRUE(daemon_->blank(false));
  EXPECT_FALSE(hand_.dark);
  end();
}

TEST_F(RealTimeDaemonTest, TellsItsFiguresWhileItRuns) {
  start();
  EXPECT_TRUE(wait_until([&] { return daemon_->frames() > 250; }));
  const auto status = daemon_->status();
  EXPECT_GT(status.frame_rate_hz, 20);
  EXPECT_LE(status.frame_rate_hz, 202);
  EXPECT_GE(status.latency_ms.gpu_draw, 0.3 - 1e-9)
      << "what the GPU says, and more where one waited";
  EXPECT_NEAR(status.gpu_ms_median, 0.5, 1e-9);
  EXPECT_GE(status.latency_ms.hand_off, 0);
  EXPECT_NE(status.material.find("phong"), std::string::npos) << status.material;
  end();
}

TEST_F(RealTimeDaemonTest, CallsBeforeAndAfterARunAreRefused) {
  auto daemon = Daemon::create(at("veneer.toml"), {}, devices()).value();
  EXPECT_EQ(daemon->reload().error().code, Errc::kUnavailable);
  EXPECT_EQ(daemon->status().state, State::kStarting);
  start();
  end();
  EXPECT_EQ(daemon_->reload().error().code, Errc::kUnavailable);
  EXPECT_EQ(daemon_->snapshot().error().code, Errc::kUnavailable);
}

}  // namespace
}  // namespace veneer::daemon
