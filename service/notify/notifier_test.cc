// SPDX-License-Identifier: Apache-2.0
#include "service/notify/notifier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

#include "base/testing/temporary_folder.h"
#include "base/unique_handle.h"
#include "service/testing/fake_control.h"

namespace veneer::service {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// systemd's end of the socket, and the environment that it gives a service.
class NotifierTest : public testing::Test {
 protected:
  void SetUp() override {
    const std::string path = (folder_.path() / "notify").string();
    socket_ = UniqueFd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
    ASSERT_EQ(::bind(socket_.value(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)),
              0);
    ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
    options_.poll = 2ms;
    options_.status = 5ms;
  }
  void TearDown() override {
    for (const char* each : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(each);
  }

  static void watch_every(Duration period) {
    ::setenv("WATCHDOG_USEC", std::to_string(period / 1us).c_str(), 1);
    ::setenv("WATCHDOG_PID", std::to_string(::getpid()).c_str(), 1);
  }

  /// The next message; empty if none comes within `patience`.
  std::string next(Duration patience = 20s) const {
    pollfd readable{socket_.value(), POLLIN, 0};
    if (::poll(&readable, 1, static_cast<int>(patience / 1ms)) <= 0) return {};
    char buffer[1024];
    const ssize_t size = ::recv(socket_.value(), buffer, sizeof buffer, 0);
    return {buffer, static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
  }
  /// The next that begins with one of these words.
  std::string next_of(const std::vector<std::string>& words, Duration patience = 20s) const {
    const Time end = SteadyClock().now() + patience;
    while (SteadyClock().now() < end) {
      std::string message = next(end - SteadyClock().now());
      for (const std::string& each : words)
        if (message.starts_with(each)) return message;
    }
    return {};
  }
  /// How many pings come within this time.
  int pings_within(Duration time) const {
    int pings = 0;
    for (const Time end = SteadyClock().now() + time; SteadyClock().now() < end;)
      pings += next_of({"WATCHDOG=1"}, end - SteadyClock().now()).empty() ? 0 : 1;
    return pings;
  }

  TemporaryFolder folder_;
  UniqueFd socket_;
  FakeControl control_;
  NotifyOptions options_;
};

TEST_F(NotifierTest, SaysNothingWhereNobodyListens) {
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_EQ(Notifier::start(control_, options_), nullptr);
  ::setenv("NOTIFY_SOCKET", "", 1);
  EXPECT_EQ(Notifier::start(control_, options_), nullptr);
  EXPECT_EQ(next(20ms), "");
}

TEST_F(NotifierTest, GoesFromStartingThroughReloadToStopping) {
  auto notifier = Notifier::start(control_, options_);
  EXPECT_EQ(next_of({"READY", "EXTEND"}), "EXTEND_TIMEOUT_USEC=20000000");
  EXPECT_EQ(next_of({"STATUS"}), "STATUS=starting");
  EXPECT_EQ(next(30ms), "") << "not ready before the first frame";

  control_.change([](ServiceStatus& s) { s.state = State::kRunning; });
  control_.advance(1);
  EXPECT_EQ(next_of({"READY"}), "READY=1\nSTATUS=running");

  control_.change([](ServiceStatus& s) {
    s.state = State::kDegraded;
    s.faults = {{FaultKind::kTracker, Time{}, "t"}, {FaultKind::kDisk, Time{}, "d"}};
    s.frame_rate_hz = 59.94;
  });
  EXPECT_EQ(next_of({"STATUS"}), "STATUS=degraded: tracker, disk; 60 frames a second");
  EXPECT_EQ(next(30ms), "") << "the same is not said twice";

  const auto before = SteadyClock().now().time_since_epoch() / 1us;
  notifier->reloading();
  const std::string reloading = next();
  EXPECT_THAT(reloading, StartsWith("RELOADING=1\nMONOTONIC_USEC="));
  const auto stamp =
      std::atoll(reloading.substr(std::strlen("RELOADING=1\nMONOTONIC_USEC=")).c_str());
  EXPECT_GE(stamp, before);
  EXPECT_LE(stamp, SteadyClock().now().time_since_epoch() / 1us + 1);
  EXPECT_EQ(next(30ms), "");
  notifier->reloaded();
  EXPECT_THAT(next(), StartsWith("READY=1\nSTATUS=degraded"));

  notifier.reset();
  EXPECT_EQ(next(), "STOPPING=1\nSTATUS=stopping");
  EXPECT_EQ(next(20ms), "");
}

TEST_F(NotifierTest, TellsReloadsThatOverlapAsOne) {
  control_.advance(1);
  const auto notifier = Notifier::start(control_, options_);
  EXPECT_THAT(next_of({"READY"}), StartsWith("READY=1"));
  notifier->reloading();
  notifier->reloading();
  EXPECT_THAT(next(), StartsWith("RELOADING=1"));
  notifier->reloaded();
  EXPECT_EQ(next(30ms), "");
  notifier->reloaded();
  EXPECT_THAT(next(), StartsWith("READY=1"));
  notifier->reloaded();  // one too many
  EXPECT_EQ(next(30ms), "");
}

TEST_F(NotifierTest, TakesAReloadBeforeTheFirstFrameForAPartOfTheStart) {
  const auto notifier = Notifier::start(control_, options_);
  EXPECT_EQ(next_of({"STATUS"}), "STATUS=starting");
  notifier->reloading();
  notifier->reloaded();
  EXPECT_EQ(next(30ms), "") << "READY=1 would be a lie";
  control_.advance(1);
  EXPECT_THAT(next_of({"READY"}), StartsWith("READY=1"));
}

TEST_F(NotifierTest, SaysStoppingOnceWhenTheDaemonStops) {
  control_.advance(1);
  auto notifier = Notifier::start(control_, options_);
  EXPECT_THAT(next_of({"READY"}), StartsWith("READY=1"));
  control_.change([](ServiceStatus& s) { s.state = State::kStopping; });
  EXPECT_EQ(next(), "STOPPING=1\nSTATUS=stopping");
  notifier.reset();
  EXPECT_EQ(next(30ms), "");
}

TEST_F(NotifierTest, AsksForTimeWhileStartingButNotForEver) {
  options_.start_extension = 40ms;
  options_.longest_start = 200ms;
  const auto notifier = Notifier::start(control_, options_);
  int asked = 0;
  while (!next_of({"EXTEND_TIMEOUT_USEC=40000"}, 500ms).empty()) ++asked;
  EXPECT_GE(asked, 2);
  EXPECT_LE(asked, 11) << "200 ms, and no more than once in 20 ms";
}

TEST_F(NotifierTest, IsSilentWhereNobodyWatches) {
  const auto notifier = Notifier::start(control_, options_);
  for (int i = 0; i < 20; ++i) {
    control_.advance(1);
    EXPECT_EQ(next_of({"WATCHDOG"}, 5ms), "");
  }
}

TEST_F(NotifierTest, LeavesTheWatchdogOfAnotherProcessAlone) {
  watch_every(40ms);
  ::setenv("WATCHDOG_PID", "1", 1);
  const auto notifier = Notifier::start(control_, options_);
  control_.advance(1);
  EXPECT_EQ(next_of({"WATCHDOG"}, 100ms), "");
}

TEST_F(NotifierTest, PingsWhileFramesGoOutAndOnlyThen) {
  constexpr Duration kPeriod = 800ms;  // a busy machine wakes a thread late
  watch_every(kPeriod);
  const auto notifier = Notifier::start(control_, options_);
  EXPECT_EQ(pings_within(kPeriod), 0) << "no frame was shown yet";
  for (int round = 0; round < 2; ++round) {
    std::atomic<bool> showing{true};
    std::thread frames([&] {
      while (showing) {
        control_.advance(1);
        std::this_thread::sleep_for(5ms);
      }
    });
    // Each period holds at least one while frames go out, or systemd would end us.
    for (int i = 0; i < 3; ++i) EXPECT_FALSE(next_of({"WATCHDOG=1"}, kPeriod).empty()) << i;
    showing = false;
    frames.join();
    // What was shown since the last ping brings one more; then none.
    EXPECT_LE(pings_within(kPeriod / 2), 2);
    EXPECT_EQ(pings_within(kPeriod), 0);
  }
}

TEST_F(NotifierTest, ADisplayThatRefusesFramesIsNoStartAndNoReasonForAnother) {
  constexpr Duration kPeriod = 800ms;
  watch_every(kPeriod);
  const auto notifier = Notifier::start(control_, options_);
  std::atomic<bool> refusing{true};
  std::thread frames([&] {
    while (refusing) {
      control_.refuse(1);
      std::this_thread::sleep_for(5ms);
    }
  });
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(next_of({"WATCHDOG=1", "READY=1"}, kPeriod).empty());
  EXPECT_EQ(next_of({"READY=1"}, kPeriod), "");
  refusing = false;
  frames.join();
  control_.advance(1);
  EXPECT_FALSE(next_of({"READY=1"}, kPeriod).empty());
}

TEST(StatusLine, IsOneLineWhateverTheFaultsSay) {
  ServiceStatus status = busy_status();
  status.faults.front().text = "two\nlines";
  EXPECT_EQ(status_line(status), "degraded: tracker, disk; 60 frames a second");
  EXPECT_EQ(status_line(ServiceStatus{}), "starting");
}

}  // namespace
}  // namespace veneer::service
