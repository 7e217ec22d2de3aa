// SPDX-License-Identifier: Apache-2.0
// The daemon and what systemd hears of it: a frame loop that hangs is not covered up by any other
// thread.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include "base/unique_handle.h"
#include "daemon/daemon.h"
#include "daemon/testing/daemon_fixture.h"
#include "service/front.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::State;

/// Holds whoever passes while it is shut.
class Gate {
 public:
  void shut() {
    const std::scoped_lock lock(mutex_);
    shut_ = true;
  }
  void open() {
    {
      const std::scoped_lock lock(mutex_);
      shut_ = false;
    }
    opened_.notify_all();
  }
  void pass() {
    std::unique_lock lock(mutex_);
    held_ += shut_ ? 1 : 0;
    opened_.wait(lock, [this] { return !shut_; });
  }
  [[nodiscard]] bool holds() {
    const std::scoped_lock lock(mutex_);
    return held_ > 0;
  }

 private:
  std::mutex mutex_;
  std::condition_variable opened_;
  bool shut_ = false;
  int held_ = 0;
};

class HangingOutput final : public testing::FakeOutput {
 public:
  HangingOutput(testing::Stagehand& hand, Gate& gate) : FakeOutput(hand), gate_(gate) {}
  Status present(const projector::Frame& frame) override {
    gate_.pass();
    return FakeOutput::present(frame);
  }

 private:
  Gate& gate_;
};

class HangingRenderer final : public testing::FakeRenderer {
 public:
  HangingRenderer(testing::Stagehand& hand, Gate& gate) : FakeRenderer(hand), gate_(gate) {}
  void finish() override { gate_.pass(); }

 private:
  Gate& gate_;
};

class WatchdogTest : public testing::DaemonFixture {
 protected:
  static constexpr Duration kPeriod = 800ms;  // pinged four times in it

  void SetUp() override {
    DaemonFixture::SetUp();
    write_config("frame_rate_hz = 200\n");
    const std::string path = at("notify").string();
    ::unlink(path.c_str());
    socket_ = UniqueFd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    ASSERT_LT(path.size(), sizeof(address.sun_path));
    std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
    ASSERT_EQ(::bind(socket_.value(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)),
              0);
    ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
    ::setenv("WATCHDOG_USEC", std::to_string(kPeriod / 1us).c_str(), 1);
    ::setenv("WATCHDOG_PID", std::to_string(::getpid()).c_str(), 1);
  }
  void TearDown() override {
    gate_.open();
    stop_ = true;
    if (ran_.valid()) {
      const Result<Summary> summary = ran_.get();
      EXPECT_TRUE(summary) << summary.error().what;
    }
    front_.reset();
    for (const char* each : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(each);
  }

  void start(Devices devices) {
    auto daemon = Daemon::create(at("veneer.toml"), {}, std::move(devices));
    ASSERT_TRUE(daemon) << daemon.error().what;
    daemon_ = *std::move(daemon);
    front_ = service::Front::start(*daemon_, {});
    ran_ = std::async(std::launch::async, [this] {
      SilentProgress silent;
      return daemon_->run(stop_, silent);
    });
  }
  /// How often WATCHDOG=1 comes within this time, but no more than `enough`.
  int pings_within(Duration time, int enough = 1000) const {
    int pings = 0;
    const Time end = SteadyClock().now() + time;
    for (Time now = SteadyClock().now(); now < end && pings < enough; now = SteadyClock().now()) {
      pollfd readable{socket_.value(), POLLIN, 0};
      if (::poll(&readable, 1, static_cast<int>((end - now) / 1ms) + 1) <= 0) continue;
      char buffer[1024];
      const ssize_t size = ::recv(socket_.value(), buffer, sizeof buffer, 0);
      if (size > 0 &&
          std::string_view(buffer, static_cast<std::size_t>(size)).starts_with("WATCHDOG=1"))
        ++pings;
    }
    return pings;
  }

  /// With the frame loop held by the gate: silence for three times what systemd waits.
  void expect_that_a_hang_is_heard() {
    ASSERT_EQ(pings_within(30s, 3), 3) << "frames go out";
    gate_.shut();
    const Time end = SteadyClock().now() + 30s;
    while (!gate_.holds() && SteadyClock().now() < end) std::this_thread::sleep_for(1ms);
    ASSERT_TRUE(gate_.holds());
    // What went out before it hung may bring one more.
    EXPECT_LE(pings_within(kPeriod / 2), 2);
    // Others are asked, and answer, meanwhile.
    EXPECT_NE(daemon_->status().state, State::kStarting);
    EXPECT_EQ(pings_within(3 * kPeriod), 0);
    EXPECT_EQ(daemon_->status().frames, daemon_->frames());
    gate_.open();
    EXPECT_EQ(pings_within(30s, 3), 3) << "frames go out again";
  }

  Gate gate_;
  UniqueFd socket_;
  std::atomic<bool> stop_{false};
  std::unique_ptr<Daemon> daemon_;
  std::unique_ptr<service::Front> front_;
  std::future<Result<Summary>> ran_;
};

TEST_F(WatchdogTest, IsNotFedWhileTheDisplayHangs) {
  Devices all = devices();
  all.open_output = [this]() -> Result<std::unique_ptr<projector::Output>> {
    return std::make_unique<HangingOutput>(hand_, gate_);
  };
  start(std::move(all));
  expect_that_a_hang_is_heard();
}

TEST_F(WatchdogTest, IsNotFedWhileTheGpuHangs) {
  Devices all = devices();
  all.make_renderer = [this](const render::Scene&,
                             std::span<const render::Level>,
                             const calibration::ProjectorProfile&,
                             const render::RendererOptions&,
                             const Scanout*) -> Result<std::unique_ptr<render::Renderer>> {
    return std::make_unique<HangingRenderer>(hand_, gate_);
  };
  start(std::move(all));
  expect_that_a_hang_is_heard();
}

}  // namespace
}  // namespace veneer::daemon
