// SPDX-License-Identifier: Apache-2.0
#include "cli/track/pose_statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace veneer::cli {
namespace {

using namespace std::chrono_literals;

tracking::PoseSample sample_at(Duration time, std::uint64_t sequence) {
  tracking::PoseSample sample;
  sample.time = Time{time};
  sample.sequence = sequence;
  return sample;
}

TEST(RunningNumbers, AgreesWithTheDefinitions) {
  Pcg32 random(1);
  std::vector<double> values;
  RunningNumbers numbers;
  for (int i = 0; i < 1000; ++i) {
    values.push_back(1e6 + random.normal());  // a large mean shows cancellation
    numbers.add(values.back());
  }
  double mean = 0;
  for (const double each : values) mean += each / 1000;
  double squares = 0;
  for (const double each : values) squares += (each - mean) * (each - mean);
  EXPECT_NEAR(numbers.mean(), mean, 1e-6);
  EXPECT_NEAR(numbers.deviation(), std::sqrt(squares / 999), 1e-6);
  EXPECT_EQ(numbers.max(), *std::max_element(values.begin(), values.end()));
}

TEST(RunningNumbers, OfNothingAndOfOneAreZeroWide) {
  RunningNumbers numbers;
  EXPECT_EQ(numbers.deviation(), 0);
  numbers.add(-3);
  EXPECT_EQ(numbers.deviation(), 0);
  EXPECT_EQ(numbers.max(), -3);
}

TEST(PoseStatistics, OfASteadyStream) {
  PoseStatistics statistics;
  for (int i = 0; i <= 100; ++i)
    statistics.add(sample_at(1s + i * 10ms, static_cast<std::uint64_t>(i)),
                   Time{1s + i * 10ms + 4ms});
  EXPECT_EQ(statistics.samples(), 101U);
  EXPECT_NEAR(statistics.rate_hz(), 100, 1e-9);
  EXPECT_NEAR(statistics.latency_s().mean(), 0.004, 1e-12);
  EXPECT_NEAR(statistics.interval_s().deviation(), 0, 1e-12);
  EXPECT_EQ(statistics.duration(), 1s);
  EXPECT_EQ(statistics.lost(), 0U);
  EXPECT_EQ(statistics.out_of_order(), 0U);
}

TEST(PoseStatistics, GapsShowAsLossesAndAsTheLongestWait) {
  PoseStatistics statistics;
  for (const int i : {0, 1, 2, 8, 9})
    statistics.add(sample_at(i * 10ms, static_cast<std::uint64_t>(i)), Time{i * 10ms});
  EXPECT_EQ(statistics.lost(), 5U);
  EXPECT_NEAR(statistics.interval_s().max(), 0.06, 1e-12);
}

TEST(PoseStatistics, WhatComesOutOfOrderIsCountedAndNotCalledLost) {
  PoseStatistics statistics;
  for (const int i : {0, 1, 3, 2, 4, 4})
    statistics.add(sample_at(i * 10ms, static_cast<std::uint64_t>(i)), Time{1s});
  EXPECT_EQ(statistics.out_of_order(), 2U);
  EXPECT_EQ(statistics.lost(), 0U);
  EXPECT_EQ(statistics.duration(), 40ms);
  EXPECT_EQ(statistics.newest()->sequence, 4U);
}

TEST(PoseStatistics, OneSampleHasNoRate) {
  PoseStatistics statistics;
  EXPECT_EQ(statistics.rate_hz(), 0);
  statistics.add(sample_at(5ms, 1), Time{7ms});
  EXPECT_EQ(statistics.rate_hz(), 0);
}

}  // namespace
}  // namespace veneer::cli
