// SPDX-License-Identifier: Apache-2.0
// The fault matrix on virtual time: a simulated LIBERTY behind its real protocol, one kind of fault
// after another, held against the path that it measures.
#include "tracking/device/device_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "tracking/drivers/polhemus/polhemus_protocol.h"
#include "tracking/drivers/simulated/path.h"
#include "tracking/drivers/simulated_device/simulated_device.h"
#include "tracking/pose_track.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Time kStart{seconds(100)};
constexpr double kFrame_s = 1.0 / 240;
const std::string kWalk =
    "[[path]]\nbody = 1\nkind = \"orbit\"\nradius_m = 1\nheight_m = 0.3\nfrom_deg = 0\n"
    "rate_deg_s = 30\n";

std::string fault(const std::string& kind,
                  double at_s,
                  double for_s,
                  const std::string& more = "") {
  return fmt::format(
      "[[fault]]\nkind = \"{}\"\nat_s = {:.6f}\nfor_s = {:.6f}\n{}\n", kind, at_s, for_s, more);
}

/// A tracker and what it measures.
struct Rig {
  explicit Rig(const std::string& text) {
    auto toml = TomlReader::parse(text + kWalk, "test");
    EXPECT_TRUE(toml);
    auto opened = open_simulated_device(*toml, clock);
    EXPECT_TRUE(opened) << opened.error().what;
    EXPECT_TRUE(toml->finish()) << toml->finish().error().what;
    tracker = *std::move(opened);
    auto again = TomlReader::parse(kWalk, "test");
    paths = Path::read_all(*again).value();
  }
  RigidTransform truth(Time when) const { return paths[0].at(to_seconds(when - kStart)); }

  /// Everything until `until_s` after the start.
  std::vector<PoseSample> run(double until_s) {
    std::vector<PoseSample> samples;
    const Time end = kStart + from_seconds(until_s);
    while (clock.now() < end) {
      const Time before = clock.now();
      const Duration patience = std::min<Duration>(milliseconds(50), end - before);
      const auto sample = tracker->wait_pose(patience);
      EXPECT_LE(clock.now() - before, patience) << "waited longer than it may";
      if (sample) {
        samples.push_back(*sample);
      } else {
        EXPECT_EQ(sample.error().code, Errc::kTimeout) << sample.error().what;
      }
    }
    return samples;
  }
  /// The same, each sample held against the truth at its time, which grows.
  std::vector<PoseSample> run_true(double until_s, double tolerance_m = 1e-4) {
    std::vector<PoseSample> samples = run(until_s);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const PoseSample& sample = samples[i];
      // 1 m/2 a second: 0.2 ms of error in time are 0.1 mm.
      EXPECT_LT((sample.world_from_body.translation - truth(sample.time).translation).norm(),
                tolerance_m)
          << "at " << to_seconds(sample.time - kStart);
      if (i > 0) {
        EXPECT_GT(sample.time, samples[i - 1].time);
        EXPECT_GT(sample.sequence, samples[i - 1].sequence);
        EXPECT_GE(sample.epoch, samples[i - 1].epoch);
      }
    }
    return samples;
  }
  [[nodiscard]] TrackerStatus status() const { return tracker->status(); }
  [[nodiscard]] TrackerCounters counters() const { return tracker->status().counters; }

  VirtualClock clock{kStart};
  std::unique_ptr<Tracker> tracker;
  std::vector<Path> paths;
};

/// The longest time between two samples.
double longest_gap_s(const std::vector<PoseSample>& samples) {
  double longest = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    longest = std::max(longest, to_seconds(samples[i].time - samples[i - 1].time));
  }
  return longest;
}

TEST(DeviceTracker, GoesThroughItsStatesInOrder) {
  Rig rig("");
  EXPECT_EQ(rig.status().state, TrackerState::kAbsent);
  std::vector<TrackerState> states{rig.status().state};
  for (int i = 0; i < 2000; ++i) {
    (void)rig.tracker->wait_pose(milliseconds(1));
    if (rig.status().state != states.back()) states.push_back(rig.status().state);
  }
  EXPECT_EQ(states,
            (std::vector{TrackerState::kAbsent,
                         TrackerState::kInitialising,
                         TrackerState::kSyncing,
                         TrackerState::kClockLocking,
                         TrackerState::kTracking}));
  const TrackerCounters counters = rig.counters();
  EXPECT_EQ(counters.opened, 1U);
  EXPECT_EQ(counters.lost + counters.late + counters.duplicates + counters.restarts, 0U);
}

TEST(DeviceTracker, MeasuresTheTruth) {
  Rig rig("delay_ms = 4\njitter_ms = 0.1\nlatency_ms = 4\nskew_ppm = 200\n");
  const auto samples = rig.run_true(5, 2e-4);  // jitter while the clock is not locked
  EXPECT_NEAR(static_cast<double>(samples.size()), 4.9 * 240, 10);
  // While it is not locked, each sample stands alone; from then on all are of one epoch.
  EXPECT_NE(samples[0].epoch, samples[1].epoch);
  EXPECT_EQ(samples[40].epoch, samples.back().epoch);
}

TEST(DeviceTracker, DuplicatesAreDroppedAndChangeNothing) {
  Rig calm("");
  Rig twice(fault("duplicate", 1, 1));
  const auto a = calm.run_true(3);
  const auto b = twice.run_true(3);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].time, b[i].time);
    EXPECT_EQ(a[i].sequence, b[i].sequence);
    EXPECT_EQ(a[i].world_from_body.translation, b[i].world_from_body.translation);
  }
  EXPECT_NEAR(static_cast<double>(twice.counters().duplicates), 240, 1);
}

TEST(DeviceTracker, SamplesThatComeTooLateAreDropped) {
  for (const int later : {1, 2, 5, 10}) {
    Rig rig(fault("reorder", 1, 1, fmt::format("samples = {}\nshare = 0.2", later)));
    const auto samples = rig.run_true(3);
    const TrackerCounters counters = rig.counters();
    EXPECT_GT(counters.late, 20U) << later;
    EXPECT_EQ(counters.late, counters.lost) << "what came too late was counted as missing";
    EXPECT_EQ(samples.size() + counters.late, Rig("").run(3).size());
    EXPECT_EQ(counters.clock_restarts, 0U);
  }
}

TEST(DeviceTracker, MissingSamplesAreCounted) {
  for (const int missing : {1, 5, 50}) {
    // Half a frame before the first one that is missing.
    Rig rig(fault("drop", 1 - kFrame_s / 2, missing * kFrame_s));
    const auto samples = rig.run_true(3);
    EXPECT_EQ(rig.counters().lost, static_cast<std::uint64_t>(missing));
    EXPECT_NEAR(longest_gap_s(samples), (missing + 1) * kFrame_s, 1e-4);
    EXPECT_EQ(rig.status().state, TrackerState::kTracking);
  }
}

TEST(DeviceTracker, AClockThatRestartsIsAnEpoch) {
  Rig rig(fault("clock-restart", 2, 0));
  const auto samples = rig.run_true(4);
  EXPECT_EQ(rig.counters().clock_restarts, 1U);
  EXPECT_EQ(rig.counters().clock_outliers, 1U);
  EXPECT_LT(longest_gap_s(samples), 2.5 * kFrame_s);  // the first one afterwards is not believed
  EXPECT_GT(samples.back().epoch, samples[200].epoch);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
}

TEST(DeviceTracker, AClockThatWrapsIsNoEpoch) {
  Rig rig("first_count = 4294966800\n");  // 496 frames before the wrap
  const auto samples = rig.run_true(4);
  EXPECT_EQ(rig.counters().clock_restarts + rig.counters().clock_outliers, 0U);
  EXPECT_EQ(samples[60].epoch, samples.back().epoch);
  EXPECT_LT(longest_gap_s(samples), 1.1 * kFrame_s);
}

TEST(DeviceTracker, AClockThatStandsStillGivesWayToArrival) {
  Rig rig("delay_ms = 1\nlatency_ms = 1\n" + fault("clock-freeze", 1, 1));
  const auto samples = rig.run_true(3);
  EXPECT_EQ(rig.counters().duplicates, 7U);  // the eighth is believed
  EXPECT_NEAR(longest_gap_s(samples), 8 * kFrame_s, 2e-3);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
}

TEST(DeviceTracker, SkewDelaysAndBurstsStayUnderAFifthOfAMillisecond) {
  for (const int skew : {-200, 200}) {
    for (const std::string& disturbance : {fault("delay", 1, 9, "delay_ms = 50\nshare = 0.05"),
                                           fault("burst", 1, 9, "samples = 8")}) {
      Rig rig(fmt::format("jitter_ms = 0.1\nskew_ppm = {}\n", skew) + disturbance);
      const auto samples = rig.run(10);
      double worst_s = 0;
      for (const PoseSample& sample : samples) {
        // Where on its path the body was tells when it was measured.
        const Eigen::Vector3d p = sample.world_from_body.translation;
        const double angle = std::remainder(std::atan2(p.x(), p.z()), 2 * std::numbers::pi);
        const double measured_s = angle / (30 * std::numbers::pi / 180);
        const double turn_s = 12;
        const double error = std::remainder(to_seconds(sample.time - kStart) - measured_s, turn_s);
        if (to_seconds(sample.time - kStart) > 0.5) worst_s = std::max(worst_s, std::abs(error));
      }
      EXPECT_LT(worst_s, 0.2e-3) << skew << disturbance;
    }
  }
}

TEST(DeviceTracker, GarbageBetweenFramesCostsNothing) {
  Rig rig(fault("garbage", 1, 1, "share = 0.3"));
  const auto samples = rig.run_true(3);
  EXPECT_EQ(rig.counters().lost, 0U);
  EXPECT_GT(rig.counters().skipped_bytes, 500U);
  EXPECT_LT(longest_gap_s(samples), 1.1 * kFrame_s);
}

TEST(DeviceTracker, BitFlipsMakeNoLastingHarm) {
  Rig rig(fault("bit-flip", 1, 1, "share = 0.5"));
  const auto samples = rig.run(4);
  // A flipped bit of a number cannot be seen here; the rest must be right again at once.
  int wrong_later = 0;
  for (const PoseSample& sample : samples) {
    const double error =
        (sample.world_from_body.translation - rig.truth(sample.time).translation).norm();
    if (to_seconds(sample.time - kStart) > 2.1 && !(error < 1e-4)) ++wrong_later;
  }
  EXPECT_EQ(wrong_later, 0);
  EXPECT_GT(rig.counters().skipped_bytes, 100U);
  EXPECT_EQ(rig.counters().opened, 1U);
}

TEST(DeviceTracker, SilenceIsToldAgainThenOpenedAgain) {
  Rig rig(fault("silence", 1, 3));
  std::vector<PoseSample> samples = rig.run(1.2);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
  rig.run(1.4);
  EXPECT_EQ(rig.status().state, TrackerState::kSilent);
  EXPECT_EQ(rig.counters().opened, 1U);
  EXPECT_EQ(rig.counters().restarts, 1U);
  rig.run(3.9);
  EXPECT_GT(rig.counters().opened, 1U);
  EXPECT_NE(rig.status().state, TrackerState::kTracking);
  rig.run_true(6);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
}

TEST(DeviceTracker, ADeviceThatResetsItselfIsStartedAgain) {
  Rig rig(fault("text", 1, 0));
  const auto samples = rig.run_true(3);
  EXPECT_EQ(rig.counters().restarts, 1U);
  EXPECT_EQ(rig.counters().opened, 1U);
  EXPECT_LT(longest_gap_s(samples), 0.3);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
}

TEST(DeviceTracker, UnpluggedItIsWaitedForAndComesBack) {
  Rig rig(fault("unplug", 1, 2.345));
  rig.run_true(1.05);
  EXPECT_EQ(rig.status().state, TrackerState::kAbsent);
  EXPECT_NE(rig.status().detail.find("unplugged"), std::string::npos) << rig.status().detail;
  rig.run(3.3);
  EXPECT_EQ(rig.status().state, TrackerState::kAbsent);
  const auto samples = rig.run_true(4);
  ASSERT_FALSE(samples.empty());
  // It is noticed at once, whatever the back-off says: the commands take 0.11 s.
  EXPECT_LT(to_seconds(samples.front().time - kStart), 3.345 + 0.15);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
  EXPECT_EQ(rig.counters().opened, 2U);
}

TEST(DeviceTracker, UnpluggedTwiceWithinATenthOfASecond) {
  Rig rig(fault("unplug", 1, 0.03) + fault("unplug", 1.08, 0.02));
  rig.run_true(3);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
  EXPECT_GE(rig.counters().opened, 2U);
}

TEST(DeviceTracker, UnpluggedWhileItIsStarted) {
  for (const double at_s : {0.001, 0.02, 0.06, 0.1, 0.111}) {
    Rig rig(fault("unplug", at_s, 0.5));
    rig.run_true(2);
    EXPECT_EQ(rig.status().state, TrackerState::kTracking) << at_s;
  }
}

TEST(DeviceTracker, AnotherDeviceIsNotTakenForIt) {
  Rig rig(fault("unplug", 1, 3) + fault("other-device", 2, 0) + fault("other-device", 2.5, 0));
  rig.run(2.6);
  EXPECT_EQ(rig.status().state, TrackerState::kAbsent);
  EXPECT_EQ(rig.counters().opened, 1U);
  rig.run_true(5);
  EXPECT_EQ(rig.status().state, TrackerState::kTracking);
}

TEST(DeviceTracker, AStallIsClearedOnceThenOpenedAgain) {
  Rig once(fault("stall", 1 - kFrame_s / 2, kFrame_s));
  once.run_true(2);
  EXPECT_EQ(once.counters().opened, 1U);
  EXPECT_EQ(once.status().state, TrackerState::kTracking);
  Rig always(fault("stall", 1, 1));
  always.run_true(8);
  EXPECT_GT(always.counters().opened, 1U);
  EXPECT_LT(always.counters().opened, 10U) << "opened again and again without a pause";
  EXPECT_EQ(always.status().state, TrackerState::kTracking);
}

TEST(DeviceTracker, ThreeErrorsInASecondOpenItAgainOneDoesNot) {
  Rig one(fault("io-error", 1 - kFrame_s / 2, kFrame_s));
  one.run_true(2);
  EXPECT_EQ(one.counters().io_errors, 1U);
  EXPECT_EQ(one.counters().opened, 1U);
  EXPECT_EQ(one.counters().lost, 1U);
  Rig many(fault("io-error", 1, 0.5));
  many.run_true(6);
  EXPECT_GT(many.counters().opened, 1U);
  EXPECT_LT(many.counters().io_errors, 40U);
  EXPECT_EQ(many.status().state, TrackerState::kTracking);
}

/// A LIBERTY whose reads fail from the opening until it is told to send.
class BadStart final : public Port {
 public:
  BadStart(IoStatus failure, Clock& clock) : failure_(failure), clock_(clock) {}
  std::string description() const override { return "bad start"; }
  Result<std::unique_ptr<Transport>> open() override {
    sends_ = false;
    return std::make_unique<Connection>(*this);
  }
  bool wait_for_arrival(Time deadline) override {
    clock_.sleep_until(deadline);
    return false;
  }
  [[nodiscard]] int failed_reads() const { return failed_reads_; }

 private:
  struct Connection final : Transport {
    explicit Connection(BadStart& device) : port(device) {}
    Received read(std::span<std::byte> buffer, Time deadline) override {
      if (!port.sends_) {
        ++port.failed_reads_;
        return {port.failure_, 0, port.clock_.now()};
      }
      const Time next = port.clock_.now() + from_seconds(kFrame_s);
      port.clock_.sleep_until(std::min(next, deadline));
      if (next > deadline) return {IoStatus::kTimeout, 0, deadline};
      PolhemusFrame frame;
      frame.count = ++port.count_;
      std::ranges::copy(encode(frame, PolhemusModel::kLiberty), buffer.begin());
      return {IoStatus::kOk, PolhemusFrame::kBytes, next};
    }
    IoStatus write(std::span<const std::byte> bytes, Time) override {
      port.sends_ = bytes.front() == std::byte{'C'};
      return IoStatus::kOk;
    }
    IoStatus clear_stall() override { return IoStatus::kOk; }
    BadStart& port;
  };
  IoStatus failure_;
  Clock& clock_;
  bool sends_ = false;
  int failed_reads_ = 0;
  std::uint32_t count_ = 0;
};

TEST(DeviceTracker, ErrorsWhileItIsStartedDoNotPutItOff) {
  for (const IoStatus failure : {IoStatus::kIo, IoStatus::kStall, IoStatus::kOverflow}) {
    VirtualClock clock{kStart};
    auto port = std::make_unique<BadStart>(failure, clock);
    const BadStart& device = *port;
    DeviceTracker tracker(
        std::move(port), std::make_unique<PolhemusProtocol>(PolhemusModel::kLiberty), {}, clock);
    EXPECT_TRUE(tracker.wait_pose(milliseconds(200))) << "the commands take 0.11 s";
    EXPECT_EQ(tracker.status().counters.opened, 1U);
    EXPECT_EQ(device.failed_reads(), 4) << "one a pause: no busy loop";
    EXPECT_EQ(tracker.status().counters.io_errors, 4U);
  }
}

TEST(DeviceTracker, ASeededStormOfFaultsIsSurvivedAndRepeatable) {
  // Everything at once, again and again.
  std::string plan = "jitter_ms = 0.5\nskew_ppm = -150\nseed = 11\n";
  Pcg32 random(99);
  const std::vector<std::string> kinds{"bit-flip",
                                       "burst",
                                       "clock-freeze",
                                       "clock-restart",
                                       "delay",
                                       "drop",
                                       "duplicate",
                                       "garbage",
                                       "invalid",
                                       "mirror",
                                       "io-error",
                                       "other-device",
                                       "reorder",
                                       "silence",
                                       "stall",
                                       "teleport",
                                       "text",
                                       "thin",
                                       "unplug"};
  for (int i = 0; i < 400; ++i) {
    plan += fault(kinds[random.next() % kinds.size()],
                  40 * random.uniform(),
                  0.3 * random.uniform(),
                  fmt::format("share = {:.3f}\nsamples = {}\ndelay_ms = 40\nshift_m = [1, 2, 3]",
                              random.uniform(),
                              1 + random.next() % 9));
  }
  const auto run = [&plan] {
    Rig rig(plan);
    std::vector<PoseSample> samples = rig.run(46);
    EXPECT_EQ(rig.status().state, TrackerState::kTracking) << rig.status().detail;
    for (std::size_t i = 1; i < samples.size(); ++i) {
      EXPECT_GT(samples[i].time, samples[i - 1].time);
      if (to_seconds(samples[i].time - kStart) > 45) {
        EXPECT_LT((samples[i].world_from_body.translation - rig.truth(samples[i].time).translation)
                      .norm(),
                  1e-3);
      }
    }
    return samples;
  };
  const auto first = run();
  const auto again = run();
  ASSERT_EQ(first.size(), again.size());
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i].time, again[i].time);
}

}  // namespace
}  // namespace veneer::tracking
