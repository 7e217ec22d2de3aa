// SPDX-License-Identifier: Apache-2.0
// VRPN over the loopback interface, on real time.
#include "tracking/drivers/vrpn/vrpn_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tracking/testing/live.h"
#include "tracking/testing/loopback.h"
#include "tracking/testing/vrpn_server.h"

namespace veneer::tracking {
namespace {

using namespace std::chrono_literals;
using vrpn::Server;

class VrpnTrackerTest : public testing::Test {
 protected:
  void open(int port) {
    auto opened = live::open(
        fmt::format("driver = \"vrpn\"\nhost = \"127.0.0.1\"\nport = {}\ntracker = \"Tracker0\"\n",
                    port),
        clock_);
    ASSERT_TRUE(opened) << opened.error().what;
    tracker_ = *std::move(opened);
  }
  /// Reads samples for a while; how many.
  int read_for(Duration duration) {
    int count = 0;
    for (const Time end = clock_.now() + duration; clock_.now() < end;)
      if (tracker_->wait_pose(20ms)) ++count;
    return count;
  }

  SteadyClock clock_;
  std::unique_ptr<Tracker> tracker_;
};

TEST_F(VrpnTrackerTest, PosesOfAServerArrive) {
  const Server server({});
  open(server.port());
  std::optional<PoseSample> last;
  for (int i = 0; i < 100; ++i) {
    const auto sample = live::next_sample(*tracker_);
    ASSERT_TRUE(sample) << tracker_->status().detail;
    EXPECT_EQ(sample->body, 1);
    // Microseconds of the stamp, and what the two clocks of the machine drift apart meanwhile.
    EXPECT_LE(sample->time, clock_.now() + 1ms);
    EXPECT_GE(sample->time, clock_.now() - 5s);
    EXPECT_EQ(sample->world_from_body.translation.tail(2), Eigen::Vector2d(2, 3));
    EXPECT_NEAR(std::abs(sample->world_from_body.rotation.z()), 1, 1e-12);
    if (last) {
      EXPECT_GT(sample->time, last->time);
      EXPECT_GT(sample->world_from_body.translation.x(), last->world_from_body.translation.x());
    }
    last = sample;
  }
  EXPECT_EQ(tracker_->status().counters.opened, 1U);
  EXPECT_EQ(tracker_->status().counters.bad_frames, 0U);
  EXPECT_EQ(server.complaint(), "");
}

TEST_F(VrpnTrackerTest, AServerThatDiesIsWaitedForAndFoundAgain) {
  auto server = std::make_unique<Server>(Server::Options{});
  const int port = server->port();
  open(port);
  const auto before = live::next_sample(*tracker_);
  ASSERT_TRUE(before);
  server.reset();
  ASSERT_TRUE(live::reaches(*tracker_, TrackerState::kAbsent));
  EXPECT_THAT(tracker_->status().detail, testing::HasSubstr(std::to_string(port)));
  read_for(300ms);
  server = std::make_unique<Server>(Server::Options{.port = port});
  ASSERT_EQ(server->port(), port);
  const auto after = live::next_sample(*tracker_);
  ASSERT_TRUE(after);
  EXPECT_GT(after->time, before->time);
  EXPECT_GT(after->sequence, before->sequence);
  EXPECT_EQ(tracker_->status().counters.opened, 2U);
  EXPECT_EQ(server->complaint(), "");
}

TEST_F(VrpnTrackerTest, AServerOfAnotherVersionIsRefusedAndTriedAgain) {
  auto server = std::make_unique<Server>(Server::Options{.version = "08.00"});
  const int port = server->port();
  open(port);
  const Time end = clock_.now() + live::kPatience;
  while (server->connections() < 2 && clock_.now() < end) ASSERT_FALSE(tracker_->wait_pose(20ms));
  EXPECT_GE(server->connections(), 2) << "the connection is closed, and another tried";
  EXPECT_GE(tracker_->status().counters.bad_frames, 1U);
  server.reset();
  server = std::make_unique<Server>(Server::Options{.port = port});
  EXPECT_TRUE(live::next_sample(*tracker_));
}

// Nothing in view: the server sends nothing, but answers. A connection that was closed for that
// would be missing when something comes into view.
TEST_F(VrpnTrackerTest, ASilentServerIsAskedAndKept) {
  Server server({.sends_poses = false});
  open(server.port());
  EXPECT_EQ(read_for(2500ms), 0);
  EXPECT_GE(server.pings(), 2);
  EXPECT_EQ(tracker_->status().state, TrackerState::kSilent);
  server.send_poses(true);
  EXPECT_TRUE(tracker_->wait_pose(5s));
  EXPECT_EQ(server.connections(), 1);
  EXPECT_EQ(server.complaint(), "");
}

TEST_F(VrpnTrackerTest, PingsAreAnswered) {
  Server server({});
  open(server.port());
  ASSERT_TRUE(live::next_sample(*tracker_));
  server.ping();
  const Time end = clock_.now() + live::kPatience;
  while (server.pongs() == 0 && clock_.now() < end) (void)tracker_->wait_pose(20ms);
  EXPECT_EQ(server.pongs(), 1);
}

// The server's wall clock is set, forwards and back: times stay ours.
TEST_F(VrpnTrackerTest, TheWallClockOfTheServerMayBeSet) {
  Server server({});
  open(server.port());
  ASSERT_GT(read_for(500ms), 0);
  for (const auto step : {3600s, -7200s}) {
    server.step_clock(step);
    ASSERT_TRUE(live::next_sample(*tracker_));
    EXPECT_GT(read_for(1s), 0);
    const auto sample = live::next_sample(*tracker_);
    ASSERT_TRUE(sample) << step.count();
    EXPECT_LE(sample->time, clock_.now() + 1ms);
    EXPECT_GE(sample->time, clock_.now() - 5s);
  }
  EXPECT_EQ(tracker_->status().counters.opened, 1U);
}

TEST(VrpnTracker, OptionsOutOfRangeAreRefused) {
  SteadyClock clock;
  for (const char* wrong : {"",
                            "tracker = \"T@host\"",
                            "tracker = \"T\"\nport = 0",
                            "tracker = \"T\"\nrate_hz = 0",
                            "tracker = \"T\"\nsensor = 1"})
    EXPECT_FALSE(live::open(fmt::format("driver = \"vrpn\"\n{}\n", wrong), clock)) << wrong;
}

}  // namespace
}  // namespace veneer::tracking
