// SPDX-License-Identifier: Apache-2.0
#include "tracking/presence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tracking/pose_track.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;

/// A body that moves at 0.2 m/s along x and is measured each 4 ms but for a gap, shown each 10 ms.
struct Walk {
  PresenceOptions options{};
  int gap_from_ms = 0;
  int gap_to_ms = 0;
  double jump_m = 0;  ///< by which it has moved when the gap ends

  struct Shown {
    int ms;
    BodyView view;
    double truth_x;
  };
  [[nodiscard]] double truth(int ms) const { return 0.2e-3 * ms + (ms >= gap_to_ms ? jump_m : 0); }
  [[nodiscard]] std::vector<Shown> run(int until_ms) const {
    PoseTrack track{{}};
    PresenceFilter filter(options);
    std::vector<Shown> shown;
    for (int ms = 0; ms < until_ms; ++ms) {
      if (ms % 4 == 0 && (ms <= gap_from_ms || ms >= gap_to_ms)) {
        PoseSample sample;
        sample.time = Time{milliseconds(ms)};
        sample.sequence = static_cast<std::uint64_t>(ms);
        sample.world_from_body.translation.x() = truth(ms);
        sample.epoch = ms >= gap_to_ms ? 1 : 0;
        EXPECT_EQ(track.add(sample), PoseTrack::Verdict::kTaken);
      }
      if (ms % 10 == 0) {
        const Time when{milliseconds(ms)};
        shown.push_back({ms, filter.update(track.at(when), when), truth(ms)});
      }
    }
    return shown;
  }
};

const Walk::Shown& at(const std::vector<Walk::Shown>& shown, int ms) {
  return *std::ranges::find(shown, ms, &Walk::Shown::ms);
}

TEST(Presence, NobodySeenIsNobody) {
  PresenceFilter filter{{}};
  const BodyView view = filter.update({}, Time{milliseconds(5)});
  EXPECT_EQ(view.presence, Presence::kNone);
  EXPECT_EQ(view.certainty, 0);
}

TEST(Presence, GoesThroughHeldStaleAndLostAtTheirTimes) {
  const Walk walk{.gap_from_ms = 1000, .gap_to_ms = 3000};
  const auto shown = walk.run(3500);
  EXPECT_EQ(at(shown, 1000).view.presence, Presence::kTracked);
  EXPECT_EQ(at(shown, 1050).view.presence, Presence::kTracked);  // predicted
  // The rest of the velocity is gone 50 + 90 ms after the last sample; stale comes before.
  EXPECT_EQ(at(shown, 1100).view.presence, Presence::kTracked);
  EXPECT_EQ(at(shown, 1110).view.presence, Presence::kStale);
  EXPECT_EQ(at(shown, 1500).view.presence, Presence::kStale);
  EXPECT_EQ(at(shown, 1510).view.presence, Presence::kLost);
  EXPECT_EQ(at(shown, 2990).view.presence, Presence::kLost);
  EXPECT_EQ(at(shown, 3000).view.presence, Presence::kTracked);
  const Walk patient{.options = {.stale_s = 0.3}, .gap_from_ms = 1000, .gap_to_ms = 3000};
  EXPECT_EQ(at(patient.run(1300), 1200).view.presence, Presence::kHeld);
}

TEST(Presence, CertaintyFadesOutWhenLostAndInWhenBack) {
  const Walk walk{.gap_from_ms = 1000, .gap_to_ms = 3000};
  const auto shown = walk.run(4000);
  EXPECT_DOUBLE_EQ(at(shown, 1500).view.certainty, 1);
  EXPECT_NEAR(at(shown, 1650).view.certainty, 0.5, 1e-9);
  EXPECT_NEAR(at(shown, 1800).view.certainty, 0, 1e-9);
  EXPECT_EQ(at(shown, 2990).view.certainty, 0);
  EXPECT_NEAR(at(shown, 3140).view.certainty, 0.5, 1e-9);
  EXPECT_EQ(at(shown, 3900).view.certainty, 1);
  for (std::size_t i = 1; i < shown.size(); ++i) {  // 10 ms of 0.3 s
    EXPECT_LE(std::abs(shown[i].view.certainty - shown[i - 1].view.certainty), 1.0 / 30 + 1e-12);
  }
}

TEST(Presence, AShortGapDoesNotTouchTheCertainty) {
  const Walk walk{.gap_from_ms = 1000, .gap_to_ms = 1400};
  for (const auto& shown : walk.run(2000)) {
    EXPECT_EQ(shown.view.certainty, 1) << shown.ms;
  }
}

TEST(Presence, ThePoseOfALostBodyStaysWhereItWasLastSeen) {
  const Walk walk{.gap_from_ms = 1000, .gap_to_ms = 3000};
  const auto shown = walk.run(3000);
  const double resting = at(shown, 2990).view.world_from_body.translation.x();
  EXPECT_NEAR(resting, walk.truth(1000), 0.2 * 0.08 + 1e-6);  // horizon and decay carry it on
  // By then nothing of the velocity is left.
  EXPECT_NEAR(at(shown, 2000).view.world_from_body.translation.x(), resting, 1e-12);
}

TEST(Presence, OnReturnItGoesToTheTruthWithoutAJump) {
  const Walk walk{.gap_from_ms = 1000, .gap_to_ms = 1180};
  const auto shown = walk.run(2000);
  double largest = 0;
  for (std::size_t i = 1; i < shown.size(); ++i) {
    largest = std::max(largest,
                       std::abs(shown[i].view.world_from_body.translation.x() -
                                shown[i - 1].view.world_from_body.translation.x()));
  }
  // It has 20 mm to catch up; at the steepest of 80 ms that is 1.5 * 20 / 8 mm a frame, and its own
  // 2 mm.
  EXPECT_LT(largest, 6.5e-3);
  for (const int ms : {1270, 1300, 1900}) {
    EXPECT_NEAR(at(shown, ms).view.world_from_body.translation.x(), walk.truth(ms), 1e-9) << ms;
  }
}

TEST(Presence, AWideJumpIsTakenAtOnce) {
  const Walk walk{.gap_from_ms = 1000, .gap_to_ms = 1180, .jump_m = 1};
  const auto shown = walk.run(1300);
  EXPECT_NEAR(at(shown, 1180).view.world_from_body.translation.x(), walk.truth(1180), 1e-9);
}

TEST(Presence, SomebodyElseFadesInAnew) {
  PresenceFilter filter{{}};
  PoseEstimate estimate;
  estimate.origin = PoseOrigin::kPredicted;
  BodyView view;
  for (int ms = 0; ms <= 500; ms += 10) view = filter.update(estimate, Time{milliseconds(ms)});
  EXPECT_EQ(view.certainty, 1);
  filter.start_over();
  EXPECT_EQ(filter.update(estimate, Time{milliseconds(510)}).certainty, 0);
}

TEST(PresenceOptions, RefusesWhatMakesNoSense) {
  for (const char* text : {"stale_s = 0",
                           "lost_s = nan",
                           "fade_s = 0",
                           "blend_s = -1",
                           "jump_m = inf",
                           "stale_s = 1\nlost_s = 0.5"}) {
    TomlReader toml = TomlReader::parse(text, "test").value();
    (void)PresenceOptions::read(toml);
    EXPECT_FALSE(toml.finish()) << text;
  }
}

}  // namespace
}  // namespace veneer::tracking
