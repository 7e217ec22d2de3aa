// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <string>

#include "base/testing/temporary_folder.h"
#include "tracking/recording.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

Result<std::unique_ptr<Tracker>> tracker_of(const std::string& text, Clock& clock) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(text, "test"));
  VENEER_ASSIGN(std::unique_ptr<Tracker> tracker, open_tracker(toml, clock));
  VENEER_TRY(toml.finish());
  return tracker;
}

constexpr const char* kSimulated = R"(
driver = "simulated"
rate_hz = 100
latency_ms = 3
path = [ { body = 1, kind = "walk", radius_m = 1, height_m = 0.2, from_deg = 0, to_deg = 90, period_s = 4 },
         { body = 7, kind = "fixed" } ]
)";

TEST(Drivers, AreSortedAndSayWhatTheyAre) {
  EXPECT_TRUE(std::ranges::is_sorted(drivers(), {}, &Driver::name));
  for (const Driver& driver : drivers()) EXPECT_FALSE(driver.summary.empty()) << driver.name;
}

TEST(Drivers, AnUnknownNameIsRefusedWithTheKnownOnes) {
  VirtualClock clock;
  for (const char* text : {"", "driver = \"\"", "driver = \"magic\""}) {
    const auto tracker = tracker_of(text, clock);
    ASSERT_FALSE(tracker) << text;
    EXPECT_EQ(tracker.error().code, Errc::kInvalidOption);
    for (const Driver& driver : drivers()) {
      EXPECT_NE(tracker.error().what.find(driver.name), std::string::npos) << tracker.error().what;
    }
  }
}

/// What every driver has to keep, whatever it talks to. Each case opens a tracker that sends about
/// 100 samples a second of each of its bodies.
struct DriverCase {
  const char* name;
  const char* config;
  bool ends;  ///< after about 2 s
};

class TrackerContract : public ::testing::TestWithParam<DriverCase> {
 protected:
  void SetUp() override {
    if (std::string(GetParam().config).find("replay") != std::string::npos) {
      ASSERT_NO_FATAL_FAILURE(record());
    }
    auto tracker =
        tracker_of(fmt::format(fmt::runtime(GetParam().config), fmt::arg("file", file_)), clock_);
    ASSERT_TRUE(tracker) << tracker.error().what;
    tracker_ = *std::move(tracker);
  }

  void record() {
    VirtualClock clock;
    auto source = tracker_of(kSimulated, clock);
    auto recorder = PoseRecorder::create(file_);
    ASSERT_TRUE(source && recorder);
    for (int i = 0; i < 400; ++i)
      ASSERT_TRUE(recorder->write((*source)->wait_pose(seconds(1)).value()));
  }

  TemporaryFolder folder_;
  std::string file_ = folder_.path() / "poses.jsonl";
  VirtualClock clock_{Time{seconds(50)}};
  std::unique_ptr<Tracker> tracker_;
};

TEST_P(TrackerContract, TimesAndSequenceNumbersOfABodyGrow) {
  std::map<BodyId, PoseSample> newest;
  for (int i = 0; i < 1000; ++i) {
    const auto sample = tracker_->wait_pose(seconds(1));
    if (!sample && GetParam().ends && sample.error().code == Errc::kDisconnected) break;
    ASSERT_TRUE(sample) << sample.error().what;
    EXPECT_LE(sample->time, clock_.now()) << "a sample from the future";
    EXPECT_NEAR(sample->world_from_body.rotation.norm(), 1, 1e-9);
    const auto [previous, is_first] = newest.try_emplace(sample->body, *sample);
    if (is_first) continue;
    EXPECT_GT(sample->time, previous->second.time);
    EXPECT_EQ(sample->sequence, previous->second.sequence + 1);
    previous->second = *sample;
  }
  EXPECT_EQ(newest.size(), 2U);
}

TEST_P(TrackerContract, WaitsNoLongerThanItMay) {
  const Duration patience = milliseconds(2);
  int timeouts = 0;
  int samples = 0;
  for (int i = 0; i < 500; ++i) {
    const Time before = clock_.now();
    const auto sample = tracker_->wait_pose(patience);
    EXPECT_LE(clock_.now() - before, patience);
    if (sample) {
      ++samples;
      continue;
    }
    ASSERT_EQ(sample.error().code, Errc::kTimeout) << sample.error().what;
    EXPECT_EQ(clock_.now() - before, patience);
    ++timeouts;
  }
  EXPECT_GT(timeouts, 100);
  EXPECT_GT(samples, 100);  // a timeout is not the end
}

TEST_P(TrackerContract, AskingWithoutPatienceDoesNotLetTimePass) {
  const Time before = clock_.now();
  int samples = 0;
  while (tracker_->wait_pose(Duration{0})) ++samples;
  EXPECT_LE(samples, 2);
  EXPECT_EQ(clock_.now(), before);
}

TEST_P(TrackerContract, TheEndIsFinalWhereThereIsOne) {
  Errc last = Errc::kTimeout;
  for (int i = 0; i < 1000 && last == Errc::kTimeout; ++i) {
    const auto sample = tracker_->wait_pose(seconds(1));
    if (!sample) last = sample.error().code;
  }
  EXPECT_EQ(last, GetParam().ends ? Errc::kDisconnected : Errc::kTimeout);
  for (int i = 0; i < 3 && GetParam().ends; ++i) {
    EXPECT_EQ(tracker_->wait_pose(seconds(1)).error().code, Errc::kDisconnected);
  }
}

TEST_P(TrackerContract, SaysWhatItIs) { EXPECT_FALSE(tracker_->description().empty()); }

// Braces are doubled for the formatter that puts the file's name in.
constexpr const char* kSimulatedPattern = R"(
driver = "simulated"
rate_hz = 100
latency_ms = 3
path = [ {{ body = 1, kind = "orbit", radius_m = 1, height_m = 0.2, from_deg = 0, rate_deg_s = 9 }},
         {{ body = 7, kind = "fixed" }} ]
)";

INSTANTIATE_TEST_SUITE_P(
    All,
    TrackerContract,
    ::testing::Values(
        DriverCase{"simulated", kSimulatedPattern, false},
        DriverCase{"replay", "driver = \"replay\"\nfile = '{file}'\n", true},
        DriverCase{"replay_loop", "driver = \"replay\"\nfile = '{file}'\nloop = true\n", false}),
    [](const auto& param_info) { return std::string(param_info.param.name); });

}  // namespace
}  // namespace veneer::tracking
