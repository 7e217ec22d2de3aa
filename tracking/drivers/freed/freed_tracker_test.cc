// SPDX-License-Identifier: Apache-2.0
// FreeD over the loopback interface, on real time.
#include "tracking/drivers/freed/freed_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tracking/drivers.h"
#include "tracking/testing/freed_writer.h"
#include "tracking/testing/live.h"
#include "tracking/testing/loopback.h"

namespace veneer::tracking {
namespace {

using namespace std::chrono_literals;
using freed::Message;

class FreedTrackerTest : public testing::Test {
 protected:
  void SetUp() override {
    auto opened = live::open(
        fmt::format("driver = \"freed\"\naddress = \"127.0.0.1\"\nport = {}\n", port_), clock_);
    ASSERT_TRUE(opened) << opened.error().what;
    tracker_ = *std::move(opened);
    ASSERT_FALSE(tracker_->wait_pose(0s));  // listens from now on
  }
  void send(const freed::Bytes& bytes) const { ASSERT_TRUE(loopback::send_datagram(port_, bytes)); }

  SteadyClock clock_;
  int port_ = loopback::free_port(SOCK_DGRAM);
  std::unique_ptr<Tracker> tracker_;
};

TEST_F(FreedTrackerTest, CamerasAreBodiesAndComeInOrder) {
  const Time start = clock_.now();
  for (int i = 0; i < 20; ++i) {
    freed::Bytes both = Message{.camera = 1, .position_mm = {1.0 * i, 0, 0}}.bytes();
    const freed::Bytes second = Message{.camera = 2, .pan_deg = 90}.bytes();
    both.insert(both.end(), second.begin(), second.end());
    send(both);
    for (const int camera : {1, 2}) {
      const auto sample = live::next_sample(*tracker_);
      ASSERT_TRUE(sample);
      EXPECT_EQ(sample->body, camera);
      EXPECT_EQ(sample->sequence, static_cast<std::uint64_t>(i) + 1);
      EXPECT_GE(sample->time, start - 1ms);
      EXPECT_LE(sample->time, clock_.now());
      if (camera == 1) {
        EXPECT_NEAR(sample->world_from_body.translation.x(), 1e-3 * i, 1e-9);
      }
    }
  }
  EXPECT_EQ(tracker_->status().state, TrackerState::kTracking);
}

TEST_F(FreedTrackerTest, WhatIsNoFreedIsCountedAndHarmsNothing) {
  freed::Bytes bad = Message{}.bytes();
  bad[5] ^= std::byte{1};
  send(bad);
  send(loopback::bytes_of("GET / HTTP/1.1"));
  send(std::vector<std::byte>(5000));
  send({});
  send(Message{.camera = 6}.bytes());
  const auto sample = live::next_sample(*tracker_);
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->body, 6);
  const TrackerCounters counters = tracker_->status().counters;
  EXPECT_EQ(counters.bad_frames, 1U);
  EXPECT_EQ(counters.skipped_bytes, bad.size() + 14);
  EXPECT_EQ(counters.opened, 1U);
}

// A port is not opened again: what comes while it is closed would be lost.
TEST_F(FreedTrackerTest, SilenceIsToldAndWaitedOut) {
  send(Message{}.bytes());
  ASSERT_TRUE(live::next_sample(*tracker_));
  ASSERT_TRUE(live::reaches(*tracker_, TrackerState::kSilent));
  const Time later = clock_.now() + 1500ms;
  while (clock_.now() < later) ASSERT_FALSE(tracker_->wait_pose(100ms));
  EXPECT_EQ(tracker_->status().state, TrackerState::kSilent);
  send(Message{}.bytes());
  ASSERT_TRUE(tracker_->wait_pose(5s));
  EXPECT_EQ(tracker_->status().state, TrackerState::kTracking);
  EXPECT_EQ(tracker_->status().counters.opened, 1U);
}

TEST(FreedTracker, APortThatIsTakenIsSaidAndTakenWhenItIsFree) {
  SteadyClock clock;
  UniqueFd other = loopback::bound_socket(SOCK_DGRAM);
  const int port = loopback::port_of(other);
  auto tracker = live::open(
      fmt::format("driver = \"freed\"\naddress = \"127.0.0.1\"\nport = {}\n", port), clock);
  ASSERT_TRUE(tracker);
  ASSERT_TRUE(live::reaches(**tracker, TrackerState::kFailed));
  EXPECT_THAT((*tracker)->status().detail, testing::HasSubstr("ss -ulpn"));
  other.reset();
  ASSERT_TRUE(live::reaches(**tracker, TrackerState::kSyncing));
}

TEST(FreedTracker, OptionsOutOfRangeAreRefused) {
  SteadyClock clock;
  for (const char* wrong :
       {"port = 0", "port = 65536", "rate_hz = 0", "up = \"x\"", "adress = \"\""})
    EXPECT_FALSE(live::open(fmt::format("driver = \"freed\"\n{}\n", wrong), clock)) << wrong;
}

}  // namespace
}  // namespace veneer::tracking
