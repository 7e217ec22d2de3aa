// SPDX-License-Identifier: Apache-2.0
#include "daemon/pose_feed.h"

#include <gtest/gtest.h>

#include "daemon/testing/fakes.h"

namespace veneer::daemon {
namespace {

using namespace std::chrono_literals;
using testing::MovingTracker;

class PoseFeedTest : public ::testing::Test {
 protected:
  PoseFeed feed(PoseFeed::OpenTracker open = {}, Time end = Time::max()) {
    return {std::make_unique<MovingTracker>(clock_, Time{1ms}, end),
            std::move(open),
            clock_,
            ClockKind::kVirtual,
            {0},
            {},
            {}};
  }
  VirtualClock clock_;
};

TEST_F(PoseFeedTest, APoseFromBeforeASleepIsHeldAndAsOldAsTheSleep) {
  PoseFeed poses = feed();
  poses.advance_to(Time{1s});
  const auto before = poses.at(0, Time{1010ms});
  ASSERT_EQ(before.origin, tracking::PoseOrigin::kPredicted);
  poses.slept(1h);
  const auto after = poses.at(0, Time{1010ms});
  EXPECT_EQ(after.origin, tracking::PoseOrigin::kHeld);
  EXPECT_EQ(after.age, before.age + 1h);
  EXPECT_EQ(after.velocity, Eigen::Vector3d::Zero());
  EXPECT_LT(after.world_from_body.translation.x(), before.world_from_body.translation.x())
      << "it is not moved on";
  poses.advance_to(Time{1100ms});
  EXPECT_EQ(poses.at(0, Time{1110ms}).origin, tracking::PoseOrigin::kPredicted)
      << "new samples are as ever";
}

TEST_F(PoseFeedTest, OpensATrackerAgainWithGrowingPauses) {
  std::vector<Time> tries;
  PoseFeed poses = feed(
      [&]() -> Result<std::unique_ptr<tracking::Tracker>> {
        tries.push_back(clock_.now());
        if (clock_.now() < Time{20s}) return fail(Errc::kNotFound, "none");
        return std::make_unique<MovingTracker>(clock_, clock_.now(), Time::max());
      },
      Time{100ms});
  for (Time now{}; now < Time{25s}; now += 10ms) poses.advance_to(now);
  EXPECT_FALSE(poses.lost());
  EXPECT_EQ(poses.reopened(), 1U);
  ASSERT_GT(tries.size(), 10U);
  EXPECT_LT(tries[0], Time{250ms}) << "the first is soon";
  for (std::size_t i = 2; i < tries.size(); ++i) {
    EXPECT_LE(tries[i] - tries[i - 1], 1020ms);
    EXPECT_GE(tries[i] - tries[i - 1] + 20ms, tries[i - 1] - tries[i - 2]);
  }
  EXPECT_EQ(poses.at(0, Time{25s}).origin, tracking::PoseOrigin::kPredicted);
}

TEST_F(PoseFeedTest, ARecordingThatHasEndedIsNotPlayedAgain) {
  class Ending final : public tracking::Tracker {
   public:
    std::string description() const override { return "a recording"; }
    Result<tracking::PoseSample> wait_pose(Duration) override {
      return fail(Errc::kDisconnected, "the recording has ended");
    }
    bool ends() const override { return true; }
  };
  int opened = 0;
  PoseFeed poses(std::make_unique<Ending>(),
                 [&]() -> Result<std::unique_ptr<tracking::Tracker>> {
                   ++opened;
                   return std::make_unique<Ending>();
                 },
                 clock_,
                 ClockKind::kVirtual,
                 {0},
                 {},
                 {});
  for (Time now{}; now < Time{5s}; now += 10ms) poses.advance_to(now);
  EXPECT_TRUE(poses.lost());
  EXPECT_EQ(opened, 0);
}

TEST_F(PoseFeedTest, FollowsMoreBodiesButNotAnyNumber) {
  PoseFeed poses = feed();
  ASSERT_TRUE(poses.follow({1, 2, 0}));
  EXPECT_EQ(poses.at(2, Time{1s}).origin, tracking::PoseOrigin::kNone);
  std::vector<tracking::BodyId> many(PoseFeed::kMostBodies);
  for (std::size_t i = 0; i < many.size(); ++i) many[i] = static_cast<int>(100 + i);
  EXPECT_EQ(poses.follow(many).error().code, Errc::kInvalidOption);
}

TEST_F(PoseFeedTest, KnowsTheWayOfTheNewestSample) {
  PoseFeed poses = feed();
  EXPECT_FALSE(poses.newest(0));
  poses.advance_to(Time{100ms});
  const auto times = poses.newest(0);
  ASSERT_TRUE(times);
  EXPECT_LE(times->measured, times->arrived);
  EXPECT_LE(times->arrived, times->ready);
  EXPECT_EQ(times->ready, poses.last_sample(0));
}

}  // namespace
}  // namespace veneer::daemon
