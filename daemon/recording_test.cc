// SPDX-License-Identifier: Apache-2.0
// A recording whose disk fails: a pipe is written until nobody reads it any more.
#include "tracking/recording.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <csignal>
#include <vector>

#include "base/unique_handle.h"
#include "daemon/recording_tracker.h"
#include "daemon/testing/daemon_fixture.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using service::FaultKind;
using service::State;

/// A file that can be written as long as it is open here.
class Pipe {
 public:
  explicit Pipe(std::filesystem::path path) : path_(std::move(path)) {
    EXPECT_EQ(::mkfifo(path_.c_str(), 0600), 0);
    open();
  }
  void open() {
    reader_ = UniqueFd(::open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    EXPECT_TRUE(reader_);
  }
  void close() { reader_.reset(); }
  /// What was written since.
  std::string read() {
    std::string text;
    char buffer[4096];
    for (ssize_t got = 0; (got = ::read(reader_.value(), buffer, sizeof(buffer))) > 0;)
      text.append(buffer, static_cast<std::size_t>(got));
    return text;
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  const std::filesystem::path path_;
  UniqueFd reader_;
};

/// A pipe that nobody reads ends a program that does not say otherwise.
class RecordingTest : public testing::DaemonFixture {
 protected:
  void SetUp() override {
    DaemonFixture::SetUp();
    std::filesystem::remove(at("poses.jsonl"));
    before_ = std::signal(SIGPIPE, SIG_IGN);
  }
  void TearDown() override { std::signal(SIGPIPE, before_); }

 private:
  void (*before_)(int) = SIG_DFL;
};

std::ptrdiff_t lines_of(const std::string& text) {
  EXPECT_TRUE(text.empty() || text.back() == '\n') << "whole lines";
  return std::ranges::count(text, '\n');
}

TEST_F(RecordingTest, PosesPassAndTheDiskIsHeardOfWhenItFailsAndWhenItWorksAgain) {
  Pipe pipe(at("poses.jsonl"));
  auto recorder = tracking::PoseRecorder::create(pipe.path()).value();
  VirtualClock clock;
  std::vector<Status> heard;
  RecordingTracker tracker(
      std::make_unique<testing::MovingTracker>(clock, clock.now() + 1ms, Time::max()),
      recorder,
      [&heard](const Status& status) { heard.push_back(status); });
  std::uint64_t last = 0;
  const auto poses = [&](int count) {
    for (int i = 0; i < count; ++i) {
      const auto sample = tracker.wait_pose(1s);
      ASSERT_TRUE(sample) << sample.error().what;
      EXPECT_EQ(sample->sequence, ++last) << "none is missing";
    }
  };
  poses(3);
  EXPECT_EQ(lines_of(pipe.read()), 1 + 3) << "a header and the poses";
  EXPECT_TRUE(heard.empty());
  pipe.close();
  poses(5);
  ASSERT_EQ(heard.size(), 1U) << "once, not with every pose";
  EXPECT_EQ(heard[0].error().code, Errc::kIo);
  pipe.open();
  poses(2);
  ASSERT_EQ(heard.size(), 2U);
  EXPECT_TRUE(heard[1]);
  EXPECT_EQ(lines_of(pipe.read()), 2);
}

TEST_F(RecordingTest, ThatCannotBeWrittenIsAFaultOfTheDiskUntilItCan) {
  Pipe pipe(at("poses.jsonl"));
  write_config("record = \"poses.jsonl\"\n");
  // Nor can a file beside it be, by which the disk is tried: its name is that of a folder.
  const std::filesystem::path probe =
      at("poses.jsonl").string() + fmt::format(".probe-{}", ::getpid());
  std::filesystem::create_directories(probe / "full");
  std::string before, after;
  service::ServiceControl* control = nullptr;
  Devices fakes = devices();
  fakes.before_frame = [&](std::uint64_t frame, Time) {
    if (frame < 20) before += pipe.read();
    if (frame == 20) pipe.close();
    const auto status = control->status();
    if (frame > 22 && frame < 100) {
      ASSERT_EQ(status.faults.size(), 1U) << frame;
      EXPECT_EQ(status.faults[0].kind, FaultKind::kDisk);
      EXPECT_NE(status.faults[0].text.find("recording poses to"), std::string::npos)
          << status.faults[0].text;
      EXPECT_FALSE(hand_.dark);
    } else if (frame < 20 || frame > 102) {
      EXPECT_TRUE(status.faults.empty()) << frame << ": " << status.faults[0].text;
    }
    if (frame == 100) pipe.open();
    if (frame > 100) after += pipe.read();
  };
  auto daemon =
      Daemon::create(
          at("veneer.toml"), {"clock=\"virtual\"", "frames=150", "frame_rate_hz=50"}, fakes)
          .value();
  control = daemon.get();
  SilentProgress silent;
  const std::atomic<bool> stop{false};
  ASSERT_TRUE(daemon->run(stop, silent));
  EXPECT_EQ(hand_.presented, 150U) << "no frame was lost";
  EXPECT_EQ(daemon->status().recovered, 1U);
  EXPECT_NE(daemon->status().tracker.find("recorded"), std::string::npos)
      << daemon->status().tracker;
  // A pose comes every 4 ms.
  EXPECT_NEAR(lines_of(before), 20 * 5, 10);
  EXPECT_NEAR(lines_of(after), 48 * 5, 15);
  std::filesystem::remove_all(probe);
}

}  // namespace
}  // namespace veneer::daemon
