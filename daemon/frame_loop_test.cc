// SPDX-License-Identifier: Apache-2.0
#include "daemon/frame_loop.h"

#include <gtest/gtest.h>

#include <numbers>
#include <optional>
#include <thread>

#include "base/statistics.h"
#include "daemon/summary.h"
#include "daemon/testing/fakes.h"
#include "render/internal_testing.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using testing::FakeOutput;
using testing::FakeRenderer;
using testing::MovingTracker;
using testing::Stagehand;

class FrameLoopTest : public ::testing::Test {
 protected:
  FrameLoopTest() {
    config_.clock = ClockKind::kVirtual;
    config_.frame_rate_hz = 50;
    config_.frames = 20;
    config_.display_latency_ms = 10;
  }
  Result<RunRecord> run(Time first_sample = Time{1ms}, Time tracker_end = Time{1h}) {
    return run(clock_,
               std::make_unique<MovingTracker>(clock_, first_sample, tracker_end),
               std::make_unique<FakeOutput>(hand_));
  }
  Result<RunRecord> run(Clock& clock,
                        std::unique_ptr<tracking::Tracker> tracker,
                        std::unique_ptr<projector::Output> output) {
    PoseFeed poses(std::move(tracker),
                   {},
                   clock,
                   config_.clock,
                   bodies_,
                   config_.prediction,
                   config_.validation);
    Faults faults;
    FigureBoard board;
    Wishes wishes;
    auto* const counting = dynamic_cast<FakeOutput*>(output.get());
    OutputKeeper keeper(
        std::move(output), [this] { return std::make_unique<FakeOutput>(hand_); }, clock, faults);
    Devices devices;
    FakeRenderer* renderer = nullptr;
    devices.make_renderer = [&](auto&&...) {
      auto made = std::make_unique<FakeRenderer>(hand_);
      renderer = made.get();
      return made;
    };
    ShowLoader loader(devices, config_.clock, poses, clock, faults);
    Script script;
    script.config = config_;
    script.scene = scene_;
    script.material = std::make_shared<render::ShaderMaterial>("");
    script.rungs = {{"full", 1, {}, script.material, {}}};
    // More of them where the fake takes its time.
    for (std::size_t i = 1; i < hand_.level_ms.size(); ++i)
      script.rungs.push_back(
          {"less", hand_.level_ms[i] / hand_.level_ms[0], {}, script.material, {}});
    script.profile.geometry.width = 4;
    script.profile.geometry.height = 3;
    script.profile.bits = 8;
    std::unique_ptr<Show> show = loader.begin(script).value();
    FrameLoop loop({config_, clock, poses, keeper, loader, faults, board, wishes, {}, asleep_},
                   std::move(show));
    SilentProgress silent;
    Result<RunRecord> record = loop.run(stop_, silent);
    faults_ = faults.list();
    inputs_ = renderer->inputs;
    if (counting != nullptr && keeper.get() == counting) times_ = counting->times;
    loader.stop(loop.take_show());
    return record;
  }

  Config config_;
  std::function<Duration()> asleep_;
  std::vector<tracking::BodyId> bodies_{0};
  std::vector<service::Fault> faults_;  ///< at the end of the last run
  render::Scene scene_;
  VirtualClock clock_;
  Stagehand hand_;
  std::vector<render::FrameInput> inputs_;
  std::vector<Time> times_;
  std::atomic<bool> stop_{false};
};

TEST_F(FrameLoopTest, ShowsOneFrameAPeriodAndNoneTwice) {
  const RunRecord record = run().value();
  EXPECT_EQ(record.count, 20U);
  EXPECT_EQ(record.dropped, 0U);
  ASSERT_EQ(times_.size(), 20U);
  for (std::size_t i = 1; i < times_.size(); ++i) {
    EXPECT_EQ(times_[i] - times_[i - 1], Duration(20ms));
  }
}

TEST_F(FrameLoopTest, DrawsForTheEyeAtTheMomentOfDisplay) {
  scene_.eye_in_sensor = {0, 0.03, 0};
  ASSERT_TRUE(run());
  // From the third frame on there are velocities; the motion is exactly what prediction assumes.
  constexpr double kRounding = 1e-9;
  for (std::size_t i = 3; i < inputs_.size(); ++i) {
    EXPECT_NEAR(inputs_[i].eye_in_world.x(), to_seconds(times_[i].time_since_epoch()), kRounding);
    EXPECT_NEAR(inputs_[i].eye_in_world.y(), 0.03, kRounding);
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
  EXPECT_TRUE(inputs_.back().eye_in_world.allFinite());
}

TEST_F(FrameLoopTest, ARunOfSoManyFramesEndsWithTheOutputsError) {
  hand_.output_broken = true;
  const auto record = run();
  ASSERT_FALSE(record);
  EXPECT_EQ(record.error().code, Errc::kIo);
  EXPECT_EQ(hand_.presented, 0U);
}

TEST_F(FrameLoopTest, EndsWhenSomebodyClosesTheOutput) {
  hand_.output_closed = true;
  const RunRecord record = run().value();
  EXPECT_EQ(record.count, 0U);
}

TEST_F(FrameLoopTest, SaysWhereTheTimeFromPoseToLightWent) {
  const RunRecord record = run().value();
  for (const FrameRecord& frame : record.frames) {
    // In virtual time nothing takes any but the display; the GPU says what it says.
    EXPECT_EQ(frame.latency_ms.tracker, 0);
    EXPECT_EQ(frame.latency_ms.hand_off, 0);
    EXPECT_GE(frame.latency_ms.wait, 0);
    EXPECT_LT(frame.latency_ms.wait, 4) << "the tracker's interval";
    // Less than was waited for it cannot be.
    EXPECT_GE(frame.latency_ms.gpu_draw, 0.3);
    EXPECT_LE(frame.latency_ms.gpu_draw, std::max(0.3, frame.frame_ms));
    EXPECT_NEAR(frame.latency_ms.compensate, 0.2, 1e-12);
    EXPECT_NEAR(frame.latency_ms.display, 10, 1e-9);
  }
}

/// Bodies 0 and 1, each measured every 4 ms; one of them is covered from some moment on.
class TwoBodies final : public tracking::Tracker {
 public:
  TwoBodies(Clock& clock, tracking::BodyId covered, Time since)
      : clock_(clock), covered_(covered), since_(since) {}
  std::string description() const override { return "two bodies"; }
  Result<tracking::PoseSample> wait_pose(Duration timeout) override {
    const Time deadline = clock_.now() + timeout;
    tracking::PoseSample sample;
    do {
      sample.body = static_cast<tracking::BodyId>(++turn_ % 2);
      sample.time = Time{static_cast<Duration::rep>(turn_ / 2) * Duration(4ms)};
    } while (sample.body == covered_ && sample.time >= since_);
    if (sample.time > deadline) {
      --turn_;
      clock_.sleep_until(deadline);
      return fail(Errc::kTimeout, "nothing yet");
    }
    clock_.sleep_until(sample.time);
    sample.sequence = ++turns_of_[static_cast<std::size_t>(sample.body)];
    return sample;
  }

 private:
  Clock& clock_;
  tracking::BodyId covered_;
  Time since_;
  std::uint64_t turn_ = 1;
  std::array<std::uint64_t, 2> turns_of_{};
};

TEST_F(FrameLoopTest, ACoveredObjectIsAFaultAndTakesTheHighlightsLikeACoveredObserver) {
  bodies_ = {0, 1};
  scene_.object_body = 1;
  config_.frames = 150;  // three seconds
  for (const auto& [covered, name] : {std::pair{0, "observer (body 0)"}, {1, "object (body 1)"}}) {
    VirtualClock clock;
    const RunRecord record =
        run(clock,
            std::make_unique<TwoBodies>(clock, static_cast<tracking::BodyId>(covered), Time{500ms}),
            std::make_unique<FakeOutput>(hand_))
            .value();
    EXPECT_EQ(record.frames.at(20).specular_weight, 1) << name;
    EXPECT_EQ(record.frames.back().specular_weight, 0) << name;
    EXPECT_EQ(inputs_.back().specular_weight, 0) << name;
    ASSERT_EQ(faults_.size(), 1U) << name;
    EXPECT_EQ(faults_[0].kind, service::FaultKind::kTracker);
    EXPECT_NE(faults_[0].text.find(name), std::string::npos) << faults_[0].text;
  }
}

TEST_F(FrameLoopTest, APoseFromBeforeASuspendIsAsOldAsTheSuspend) {
  static constexpr Time kSuspend{210ms};
  asleep_ = [this]() -> Duration { return clock_.now() < kSuspend ? 5s : 5s + 1h; };
  const RunRecord record = run(Time{1ms}, Time{200ms}).value();
  for (const FrameRecord& frame : record.frames) {
    // CLOCK_MONOTONIC alone would have it some milliseconds old.
    const bool before = frame.display_time - 10ms < kSuspend;
    if (before) {
      EXPECT_LT(frame.pose_age_ms, 100);
    } else {
      EXPECT_GT(frame.pose_age_ms, 3.6e6);
      EXPECT_GE(frame.presence, tracking::Presence::kHeld);
    }
  }
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
  const RunRecord record =
      run(clock,
          std::make_unique<MovingTracker>(clock, clock.now(), clock.now() + 1h),
          std::make_unique<SlowOutput>())
          .value();
  EXPECT_GE(record.dropped, 4U);
  EXPECT_GE(record.late, 1U);
}

class RefreshedFrameLoopTest : public FrameLoopTest {
 protected:
  static constexpr Duration kPeriod = 20ms;
  RefreshedFrameLoopTest() {
    config_.clock = ClockKind::kMonotonic;
    config_.frame_rate_hz = 50;
    config_.frames = 75;
    config_.display_latency_ms = 4;
  }
  /// The frames of the second half: the phase is known by then.
  std::vector<FrameRecord> settled(Latch latch) {
    config_.latch = latch;
    SteadyClock clock;
    // Nothing in the loop could guess this phase.
    const RunRecord record =
        run(clock,
            std::make_unique<MovingTracker>(clock, clock.now(), clock.now() + 1h),
            std::make_unique<testing::RefreshingOutput>(clock, kPeriod, clock.now() + 313ms))
            .value();
    return {record.frames.end() - std::ssize(record.frames) / 2, record.frames.end()};
  }
  static double median_of(const std::vector<FrameRecord>& frames,
                          const std::function<double(const FrameRecord&)>& value) {
    std::vector<double> values;
    for (const FrameRecord& frame : frames)
      if (frame.presented) values.push_back(value(frame));
    return quantile(values, 0.5);
  }
};

TEST_F(RefreshedFrameLoopTest, PredictsForTheRefreshThatTheDisplayTellsOf) {
  const std::vector<FrameRecord> frames = settled(Latch::kLate);
  const auto told = std::ranges::count_if(
      frames, [](const FrameRecord& frame) { return frame.presented.has_value(); });
  EXPECT_GT(told, std::ssize(frames) / 2);
  // From the light for which a frame was made to that by which it was seen. A display whose phase
  // is not followed is off by any part of a period.
  const double error_ms = median_of(frames, [](const FrameRecord& frame) {
    return 1e3 * std::abs(to_seconds(*frame.presented + 4ms - frame.display_time));
  });
  EXPECT_LT(error_ms, 2);
  // And the budget's last part is what was seen, not what was planned.
  for (const FrameRecord& frame : frames) {
    if (!frame.presented) continue;
    EXPECT_NEAR(frame.latency_ms.display,
                1e3 * to_seconds(*frame.presented + 4ms - frame.handed_over),
                1e-6);
  }
}

TEST_F(RefreshedFrameLoopTest, LateLatchingShowsYoungerPoses) {
  const auto age = [](const FrameRecord& frame) { return frame.pose_age_ms; };
  const double late_ms = median_of(settled(Latch::kLate), age);
  const double early_ms = median_of(settled(Latch::kEarly), age);
  // Drawing takes next to nothing here: early, a pose waits for nearly a whole period.
  EXPECT_LT(late_ms, early_ms - 0.4 * to_seconds(kPeriod) * 1e3);
}

TEST_F(FrameLoopTest, TakesACheaperRungWhereFramesMissTheirDeadline) {
  config_.clock = ClockKind::kMonotonic;
  config_.frame_rate_hz = 100;
  config_.frames = 100;
  config_.quality.mode = quality::GovernorMode::kDeadline;
  hand_.level_ms = {30, 20, 1};
  SteadyClock clock;
  const RunRecord record = run(clock,
                               std::make_unique<MovingTracker>(clock, clock.now(), Time::max()),
                               std::make_unique<FakeOutput>(hand_))
                               .value();
  EXPECT_EQ(record.frames.front().rung, 0U);
  EXPECT_EQ(record.frames.back().rung, 2U) << "the one between would miss it too";
  EXPECT_GE(record.quality_steps, 1U);
  EXPECT_EQ(inputs_.back().level, 2U);
  const Summary summary = summarise(record);
  ASSERT_EQ(summary.frames_on_rung.size(), 3U);
  EXPECT_GE(summary.frames_on_rung[2], 70U);
}

TEST_F(FrameLoopTest, OnAVirtualClockStaysOnTheFirstRung) {
  config_.quality.mode = quality::GovernorMode::kDeadline;
  config_.quality.deadline_ms = 0.5;
  hand_.level_ms = {2, 1};
  const RunRecord record = run().value();
  EXPECT_EQ(record.frames.back().rung, 0U);
  EXPECT_EQ(record.quality_steps, 0U);
}

TEST_F(FrameLoopTest, InTheModeFixedDrawsTheRungThatIsNamed) {
  config_.quality.mode = quality::GovernorMode::kFixed;
  config_.quality.rung = 1;
  hand_.level_ms = {0.01, 0.01, 0.01};
  ASSERT_TRUE(run());
  for (const render::FrameInput& input : inputs_) EXPECT_EQ(input.level, 1U);
}

}  // namespace
}  // namespace veneer::daemon
