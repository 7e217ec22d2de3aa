// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/replay/replay_tracker.h"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "base/files.h"
#include "base/testing/temporary_folder.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;

class ReplayTrackerTest : public ::testing::Test {
 protected:
  /// Records body 1 at 0, 10, 30 ms, from 5 s and sequence number 40 on.
  void record() const {
    auto recorder = PoseRecorder::create(file_);
    ASSERT_TRUE(recorder) << recorder.error().what;
    for (const int ms : {0, 10, 30}) {
      PoseSample sample;
      sample.body = 1;
      sample.time = Time{milliseconds(5000 + ms)};
      sample.sequence = 40U + static_cast<unsigned>(ms) / 10;
      sample.world_from_body.translation.x() = ms;
      ASSERT_TRUE(recorder->write(sample));
    }
  }
  Result<std::unique_ptr<ReplayTracker>> open(const std::string& more = "") {
    VENEER_ASSIGN(TomlReader toml,
                  TomlReader::parse(fmt::format("file = '{}'\n{}", file_.string(), more), "test"));
    VENEER_ASSIGN(std::unique_ptr<ReplayTracker> tracker, ReplayTracker::open(toml, clock_));
    VENEER_TRY(toml.finish());
    return tracker;
  }

  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "poses.jsonl";
  VirtualClock clock_{Time{std::chrono::seconds(100)}};
};

TEST_F(ReplayTrackerTest, KeepsThePaceOfTheRecording) {
  record();
  for (const auto& [speed, step] : {std::pair{1.0, 10}, {0.5, 20}, {10.0, 1}}) {
    auto tracker = open(fmt::format("speed = {}", speed));
    ASSERT_TRUE(tracker) << tracker.error().what;
    const Time start = clock_.now();
    for (const int steps : {0, 1, 3}) {
      const auto sample = (*tracker)->wait_pose(std::chrono::seconds(1));
      ASSERT_TRUE(sample);
      EXPECT_EQ(sample->time, start + milliseconds(steps * step));
      EXPECT_EQ(clock_.now(), sample->time);
      EXPECT_EQ(sample->world_from_body.translation.x(), 10 * steps);
      EXPECT_EQ(sample->sequence, 40U + static_cast<unsigned>(steps));
    }
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ((*tracker)->wait_pose(std::chrono::seconds(1)).error().code, Errc::kDisconnected);
    }
  }
}

TEST_F(ReplayTrackerTest, ATimeoutLosesNoSample) {
  record();
  auto tracker = open();
  ASSERT_TRUE(tracker);
  ASSERT_TRUE((*tracker)->wait_pose(milliseconds(0)));
  const Time start = clock_.now();
  EXPECT_EQ((*tracker)->wait_pose(milliseconds(4)).error().code, Errc::kTimeout);
  EXPECT_EQ(clock_.now(), start + milliseconds(4));
  const auto sample = (*tracker)->wait_pose(milliseconds(10));
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->sequence, 41U);
}

TEST_F(ReplayTrackerTest, TimesAndNumbersGoOnGrowingInALoop) {
  record();
  auto tracker = open("loop = true");
  ASSERT_TRUE(tracker);
  Time previous = clock_.now() - milliseconds(1);
  std::uint64_t sequence = 39;
  for (int i = 0; i < 30; ++i) {
    const auto sample = (*tracker)->wait_pose(std::chrono::seconds(1));
    ASSERT_TRUE(sample) << i;
    EXPECT_GT(sample->time, previous);
    EXPECT_GT(sample->sequence, sequence);
    previous = sample->time;
    sequence = sample->sequence;
  }
  // Three samples in 30 ms, a mean step of 15 ms between the loops.
  EXPECT_EQ(clock_.now(),
            Time{std::chrono::seconds(100)} + 9 * milliseconds(45) + milliseconds(30));
}

TEST_F(ReplayTrackerTest, LoopsOverASingleSample) {
  ASSERT_TRUE(write_text(file_,
                         "{\"format\":\"veneer-poses\",\"version\":1}\n"
                         "{\"t_ns\":5,\"body\":1,\"seq\":2,\"p\":[1,2,3],\"q\":[1,0,0,0]}\n"));
  auto tracker = open("loop = true");
  ASSERT_TRUE(tracker);
  ASSERT_TRUE((*tracker)->wait_pose(std::chrono::seconds(1)));
  const auto again = (*tracker)->wait_pose(std::chrono::seconds(1));
  ASSERT_TRUE(again);
  EXPECT_EQ(again->sequence, 3U);
}

TEST_F(ReplayTrackerTest, ReportsALineThatWasCutShort) {
  record();
  auto text = read_text(file_);
  ASSERT_TRUE(text);
  ASSERT_TRUE(write_text(file_, text->substr(0, text->size() - 5)));
  auto tracker = open();
  ASSERT_TRUE(tracker) << tracker.error().what;
  EXPECT_NE((*tracker)->description().find("cut short"), std::string::npos);
}

TEST_F(ReplayTrackerTest, LosesTheDeviceWhenTheFileIsDamagedMeanwhile) {
  record();
  auto tracker = open("loop = true");
  ASSERT_TRUE(tracker);
  std::filesystem::remove(file_);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE((*tracker)->wait_pose(std::chrono::seconds(1)));
  EXPECT_EQ((*tracker)->wait_pose(std::chrono::seconds(1)).error().code, Errc::kDisconnected);
}

TEST_F(ReplayTrackerTest, RefusesBadOptionsAndFiles) {
  EXPECT_EQ(open().error().code, Errc::kNotFound);
  record();
  for (const char* bad : {"speed = 0", "speed = -1", "speed = 1000", "loop = 3", "pace = 1"}) {
    const auto tracker = open(bad);
    ASSERT_FALSE(tracker) << bad;
    EXPECT_EQ(tracker.error().code, Errc::kInvalidOption) << bad;
  }
  const std::string header = "{\"format\":\"veneer-poses\",\"version\":1}\n";
  const std::string pose = "\"body\":1,\"seq\":2,\"p\":[1,2,3],\"q\":[1,0,0,0]}\n";
  for (const std::string& text : {header,
                                  header + "nonsense\n",
                                  header + "{\"t_ns\":-9223372036854775808," + pose +
                                      "{\"t_ns\":9223372036854775807," + pose}) {
    ASSERT_TRUE(write_text(file_, text));
    const auto tracker = open();
    ASSERT_FALSE(tracker) << text;
    EXPECT_EQ(tracker.error().code, Errc::kBadFormat) << text;
  }
}

}  // namespace
}  // namespace veneer::tracking
