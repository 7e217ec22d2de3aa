// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "tracking/drivers.h"

// Drivers as the daemon opens them, the real libusb and hidapi below them, on a mocked bus. Times
// here are real, so that limits on them are loose.
namespace veneer::tracking {

class DriversOnTheBus : public ::testing::Test {
 protected:
  void open(const std::string& config) {
    auto toml = TomlReader::parse(config, "test");
    ASSERT_TRUE(toml);
    auto tracker = open_tracker(*toml, clock_);
    ASSERT_TRUE(tracker) << tracker.error().what;
    const Status finished = toml->finish();
    ASSERT_TRUE(finished) << finished.error().what;
    tracker_ = *std::move(tracker);
  }
  /// Lets the tracker work until `done`; false if that takes too long.
  bool run_until(const std::function<bool()>& done, Duration patience = std::chrono::seconds(10)) {
    const Time give_up = clock_.now() + patience;
    while (!done() && clock_.now() < give_up) {
      const auto sample = tracker_->wait_pose(std::chrono::milliseconds(20));
      if (sample) {
        newest_ = *sample;
        ++samples_;
      } else {
        EXPECT_EQ(sample.error().code, Errc::kTimeout) << sample.error().what;
      }
    }
    return done();
  }
  void run_for(Duration duration) {
    const Time end = clock_.now() + duration;
    EXPECT_FALSE(run_until([] { return false; }, end - clock_.now()));
  }
  bool run_until_state(TrackerState state) {
    return run_until([this, state] { return tracker_->status().state == state; });
  }
  /// Whether samples come, now.
  bool tracks() {
    const std::uint64_t before = samples_;
    return run_until([&] { return samples_ >= before + 10; });
  }
  TrackerStatus status() const { return tracker_->status(); }

  SteadyClock clock_;
  std::unique_ptr<Tracker> tracker_;
  PoseSample newest_;
  std::uint64_t samples_ = 0;
};

}  // namespace veneer::tracking
