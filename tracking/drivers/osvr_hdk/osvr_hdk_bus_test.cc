// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <utility>

#include "tracking/testing/drivers_on_the_bus.h"
#include "tracking/testing/mock_hidraw.h"

namespace veneer::tracking {
namespace {

TEST_F(DriversOnTheBus, TheHdkTracksCountsItsGapsAndDropsWhatItDoesNotKnow) {
  mock::HidrawDevice hdk({0x1532, 0x0b00, "OSVR HDK", "K1", "2-2", 0});
  ASSERT_NO_FATAL_FAILURE(open("driver = \"osvr-hdk\"\nposition_m = [1, 2, 3]"));
  hdk.plug();
  std::atomic<bool> ended{false};
  std::thread sender([&] {
    for (int sequence = 0; !ended; sequence += sequence % 50 == 0 ? 2 : 1) {
      std::this_thread::sleep_for(std::chrono::microseconds(2500));
      mock::Bytes report(32);
      report[0] = std::byte{2};
      report[1] = static_cast<std::byte>(sequence & 0xFF);
      report[9] = std::byte{0x40};  // w = 1
      hdk.send(std::move(report));
      if (sequence % 20 == 0) hdk.send(mock::Bytes(16));  // version 0
    }
  });
  EXPECT_TRUE(tracks());
  EXPECT_EQ(newest_.world_from_body.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(
      run_until([&] { return status().counters.lost >= 2 && status().counters.bad_frames >= 2; }));
  EXPECT_EQ(status().counters.opened, 1U);
  ended = true;
  sender.join();
  tracker_.reset();
}

}  // namespace
}  // namespace veneer::tracking
