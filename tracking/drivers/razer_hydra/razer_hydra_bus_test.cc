// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <set>
#include <string>
#include <thread>

#include "tracking/testing/drivers_on_the_bus.h"
#include "tracking/testing/mock_hidraw.h"

namespace veneer::tracking {
namespace {

using std::chrono::milliseconds;

mock::Bytes motion_report() {
  mock::Bytes report(52);
  for (const std::size_t block : {std::size_t{8}, std::size_t{30}}) {
    report[block] = std::byte{100};       // x = 100 mm
    report[block + 7] = std::byte{0x7F};  // w = 0x7F00 / 32768
  }
  return report;
}

/// Two nodes of one device, which sends motion when it was told to.
class HydraOnTheBus : public DriversOnTheBus {
 protected:
  void SetUp() override { ASSERT_NO_FATAL_FAILURE(open("driver = \"razer-hydra\"")); }
  void TearDown() override {
    ended_ = true;
    thread_.join();
    tracker_.reset();
  }
  void plug() {
    motion_ = false;
    control_.plug();
    data_.plug();
  }
  void unplug() {
    data_.unplug();
    control_.unplug();
  }

  std::atomic<bool> motion_{false};
  std::atomic<std::size_t> other_size_{0};  // of the reports without motion; 0: none
  std::atomic<bool> ended_{false};
  mock::HidrawDevice control_{{0x1532, 0x0300, "Razer Hydra", "H1", "2-1", 1},
                              [this](const mock::Bytes& report) {
                                motion_ = report[9] == std::byte{3};
                                return 0;
                              }};
  mock::HidrawDevice data_{{0x1532, 0x0300, "Razer Hydra", "H1", "2-1", 0}};
  std::thread thread_{[this] {
    while (!ended_) {
      std::this_thread::sleep_for(milliseconds(4));
      if (motion_) {
        data_.send(motion_report());
      } else if (other_size_ > 0) {
        data_.send(mock::Bytes(other_size_));
      }
    }
  }};
};

TEST_F(HydraOnTheBus, IsToldToReportMotionAndTracksBothControllers) {
  plug();
  ASSERT_TRUE(tracks());
  std::set<BodyId> bodies;
  ASSERT_TRUE(run_until([&] {
    if (samples_ > 0) bodies.insert(newest_.body);
    return bodies.size() == 2;
  }));
  EXPECT_EQ(bodies, (std::set<BodyId>{1, 2}));
  EXPECT_NEAR(newest_.world_from_body.translation.x(), 0.1, 1e-9);
}

TEST_F(HydraOnTheBus, ReplugUnderAnotherNumberTracksAgain) {
  plug();
  ASSERT_TRUE(tracks());
  const std::string node = data_.node();
  unplug();
  EXPECT_TRUE(run_until_state(TrackerState::kAbsent));
  plug();
  EXPECT_NE(data_.node(), node);
  EXPECT_TRUE(tracks());
}

TEST_F(HydraOnTheBus, AModeLostBehindOurBackIsSetAgainWithoutOpeningItAgain) {
  plug();
  ASSERT_TRUE(tracks());
  for (const std::size_t size : {std::size_t{16}, std::size_t{51}, std::size_t{53}}) {
    const TrackerCounters before = status().counters;
    const std::uint64_t features = control_.features();
    other_size_ = size;
    motion_ = false;
    ASSERT_TRUE(run_until([&] { return control_.features() > features; })) << size;
    ASSERT_TRUE(tracks()) << size;
    EXPECT_EQ(status().counters.opened, before.opened);
    // Once, as a rule; on a busy machine what was sent before may still be read after it.
    EXPECT_LE(control_.features(), features + 3);
    EXPECT_GE(status().counters.bad_frames, before.bad_frames + 1);
  }
}

TEST_F(HydraOnTheBus, StrangeReportsAmongTheOthersAreDroppedOnly) {
  plug();
  ASSERT_TRUE(tracks());
  const TrackerCounters before = status().counters;
  for (const std::size_t size :
       {std::size_t{51}, std::size_t{53}, std::size_t{16}, std::size_t{1}}) {
    data_.send(mock::Bytes(size, std::byte{0x7F}));
    ASSERT_TRUE(tracks());
  }
  EXPECT_TRUE(run_until([&] { return status().counters.bad_frames == before.bad_frames + 4; }));
  EXPECT_EQ(status().counters.opened, before.opened);
  EXPECT_EQ(status().counters.restarts, before.restarts);
}

}  // namespace
}  // namespace veneer::tracking
