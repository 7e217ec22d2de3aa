// SPDX-License-Identifier: Apache-2.0
#include "daemon/frame_loop.h"

#include <gtest/gtest.h>

#include <numbers>
#include <optional>

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;

/// A body that moves along x at 1 m/s and is measured every 4 ms; gone after `end`.
class MovingTracker final : public tracking::Tracker {
 public:
  MovingTracker(Clock& clock, Time first, Time end) : clock_(clock), next_(first), end_(end) {}
  std::string description() const override { return "a moving body"; }
  Result<tracking::PoseSample> wait_pose(Duration timeout) override {
    if (next_ > end_) return fail(Errc::kDisconnected, "unplugged");
    const Time deadline = clock_.now() + timeout;
    clock_.sleep_until(std::min(next_, deadline));
    if (next_ > deadline) return fail(Errc::kTimeout, "nothing yet");
    tracking::PoseSample sample;
    sample.time = next_;
    sample.sequence = ++sequence_;
    sample.world_from_body.translation.x() = to_seconds(next_.time_since_epoch());
    next_ += 4ms;
    return sample;
  }

 private:
  Clock& clock_;
  Time next_;
  Time end_;
  std::uint64_t sequence_ = 0;
};

/// Remembers what it was asked to draw.
class RecordingRenderer final : public render::Renderer {
 public:
  void release() override {}
  bool lost() override { return false; }
  void draw_to_scanout(std::size_t /*buffer*/) override {}
  Status set_profile(const render::PreparedProfile&) override { return {}; }
  void draw(const render::FrameInput& input) override { inputs.push_back(input); }
  void read_codes(ImageView<Rgb16> codes) override { codes(0, 0) = {7, 8, 9}; }
  void read_target(ImageView<Rgb32f>) override {}
  void finish() override {}
  render::FrameStatistics statistics() override { return {}; }
  std::string description() const override { return "recording"; }
  std::vector<render::FrameInput> inputs;
};

class CountingOutput final : public projector::Output {
 public:
  std::string description() const override { return "counting"; }
  bool wants_pixels(std::uint64_t) const override { return true; }
  Status present(const projector::Frame& frame) override {
    if (fail_at && frame.number == *fail_at) return fail(Errc::kIo, "the disk is full");
    EXPECT_EQ(frame.codes(0, 0), (Rgb16{7, 8, 9}));
    times.push_back(frame.display_time);
    return {};
  }
  std::optional<std::uint64_t> fail_at;
  std::vector<Time> times;
};

class FrameLoopTest : public testing::Test {
 protected:
  FrameLoopTest() {
    config_.clock = ClockKind::kVirtual;
    config_.frame_rate_hz = 50;
    config_.frames = 20;
    config_.display_latency_ms = 10;
  }
  Result<RunRecord> run(Time first_sample = Time{1ms}, Time tracker_end = Time{1h}) {
    MovingTracker tracker(clock_, first_sample, tracker_end);
    PoseFeed poses(tracker, clock_, config_.clock, {0}, config_.prediction, config_.validation);
    FrameLoop loop(config_, scene_, {4, 3, 8}, clock_, poses, renderer_, output_);
    SilentProgress silent;
    return loop.run(stop_, silent);
  }

  Config config_;
  render::Scene scene_;
  VirtualClock clock_;
  RecordingRenderer renderer_;
  CountingOutput output_;
  std::atomic<bool> stop_{false};
};

TEST_F(FrameLoopTest, ShowsOneFrameAPeriodAndNoneTwice) {
  const RunRecord record = run().value();
  EXPECT_EQ(record.count, 20U);
  EXPECT_EQ(record.dropped, 0U);
  ASSERT_EQ(output_.times.size(), 20U);
  for (std::size_t i = 1; i < output_.times.size(); ++i) {
    EXPECT_EQ(output_.times[i] - output_.times[i - 1], Duration(20ms));
  }
}

TEST_F(FrameLoopTest, DrawsForTheEyeAtTheMomentOfDisplay) {
  scene_.eye_in_sensor = {0, 0.03, 0};
  ASSERT_TRUE(run());
  // From the third frame on there are velocities; the motion is exactly what prediction assumes.
  constexpr double kRounding = 1e-9;
  for (std::size_t i = 3; i < renderer_.inputs.size(); ++i) {
    EXPECT_NEAR(renderer_.inputs[i].eye_in_world.x(),
                to_seconds(output_.times[i].time_since_epoch()),
                kRounding);
    EXPECT_NEAR(renderer_.inputs[i].eye_in_world.y(), 0.03, kRounding);
  }
}

TEST_F(FrameLoopTest, TellsHowOldThePoseIs) {
  const RunRecord record = run().value();
  for (const FrameRecord& frame : record.frames) {
    EXPECT_GE(frame.pose_age_ms, 10) << "at least the display's latency";
    EXPECT_LE(frame.pose_age_ms, 14) << "and at most one sample more";
  }
}

TEST_F(FrameLoopTest, GivesUpWhenNoPoseComes) {
  config_.first_pose_timeout_s = 0.5;
  const auto record = run(Time{10s});
  ASSERT_FALSE(record);
  EXPECT_EQ(record.error().code, Errc::kTimeout);
  EXPECT_NE(record.error().what.find("body 0"), std::string::npos) << record.error().what;
}

TEST_F(FrameLoopTest, SaysThatTheTrackerIsGoneBeforeTheFirstPose) {
  const auto record = run(Time{10s}, Time{1s});
  ASSERT_FALSE(record);
  EXPECT_EQ(record.error().code, Errc::kDisconnected);
}

TEST_F(FrameLoopTest, GoesOnWithTheLastPoseWhenTheTrackerGoes) {
  const RunRecord record = run(Time{1ms}, Time{100ms}).value();
  EXPECT_EQ(record.count, 20U);
  EXPECT_EQ(record.frames.back().presence, tracking::Presence::kStale);
  EXPECT_GT(record.held, 0U);
  EXPECT_TRUE(renderer_.inputs.back().eye_in_world.allFinite());
}

TEST_F(FrameLoopTest, EndsWithTheOutputsError) {
  output_.fail_at = 3;
  const auto record = run();
  ASSERT_FALSE(record);
  EXPECT_EQ(record.error().code, Errc::kIo);
  EXPECT_EQ(output_.times.size(), 3U);
}

TEST_F(FrameLoopTest, StopsWhenAsked) {
  stop_ = true;
  const RunRecord record = run().value();
  EXPECT_EQ(record.count, 0U);
}

TEST_F(FrameLoopTest, CountsTheFramesItLosesInRealTime) {
  /// Takes five periods for its third frame.
  class SlowOutput final : public projector::Output {
   public:
    std::string description() const override { return "slow"; }
    bool wants_pixels(std::uint64_t) const override { return false; }
    Status present(const projector::Frame& frame) override {
      if (frame.number == 2) std::this_thread::sleep_for(50ms);
      return {};
    }
  };
  config_.clock = ClockKind::kMonotonic;
  config_.frame_rate_hz = 100;
  config_.frames = 5;
  SteadyClock clock;
  MovingTracker tracker(clock, clock.now(), clock.now() + 1h);
  PoseFeed poses(tracker, clock, config_.clock, {0}, config_.prediction, config_.validation);
  SlowOutput output;
  FrameLoop loop(config_, scene_, {4, 3, 8}, clock, poses, renderer_, output);
  SilentProgress silent;
  const RunRecord record = loop.run(stop_, silent).value();
  EXPECT_GE(record.dropped, 4U);
  EXPECT_GE(record.late, 1U);
}

}  // namespace
}  // namespace veneer::daemon
