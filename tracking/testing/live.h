// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>

#include "tracking/drivers.h"

// For tests of drivers on real time. Nothing is expected to be quick, only to happen.
namespace veneer::tracking::live {

constexpr Duration kPatience = std::chrono::seconds(20);

/// @param table  the [tracker] table.
inline Result<std::unique_ptr<Tracker>> open(const std::string& table, Clock& clock) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::parse(table, "test"));
  VENEER_ASSIGN(std::unique_ptr<Tracker> tracker, open_tracker(toml, clock));
  VENEER_TRY(toml.finish());
  return tracker;
}

/// The next sample; nothing where none comes.
inline std::optional<PoseSample> next_sample(Tracker& tracker) {
  const SteadyClock clock;
  const Time end = clock.now() + kPatience;
  while (clock.now() < end) {
    const Result<PoseSample> sample = tracker.wait_pose(std::chrono::milliseconds(50));
    if (sample) return *sample;
  }
  return std::nullopt;
}

/// Reads the tracker until it is in this state.
inline testing::AssertionResult reaches(Tracker& tracker, TrackerState state) {
  const SteadyClock clock;
  const Time end = clock.now() + kPatience;
  while (clock.now() < end) {
    if (tracker.status().state == state) return testing::AssertionSuccess();
    (void)tracker.wait_pose(std::chrono::milliseconds(10));
  }
  return testing::AssertionFailure()
         << "it is " << name_of(tracker.status().state) << ": " << tracker.status().detail;
}

}  // namespace veneer::tracking::live
