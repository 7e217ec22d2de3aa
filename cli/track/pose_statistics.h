// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/clock.h"
#include "tracking/pose.h"

namespace veneer::cli {

/// Mean, spread and extremes of numbers that come one by one.
/// Source: Welford 1962, "Note on a Method for Calculating Corrected Sums of Squares and Products".
class RunningNumbers {
 public:
  void add(double value);
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] double mean() const { return mean_; }
  [[nodiscard]] double deviation() const;            ///< standard deviation; 0 for fewer than two
  [[nodiscard]] double max() const { return max_; }  ///< 0 where there is none
  [[nodiscard]] double sum() const { return mean_ * static_cast<double>(count_); }

 private:
  std::uint64_t count_ = 0;
  double mean_ = 0;
  double squares_ = 0;  // of the distances from the mean
  double max_ = 0;
};

/// How well one body is tracked, by its samples and when they came.
class PoseStatistics {
 public:
  void add(const tracking::PoseSample& sample, Time arrival);

  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  /// Missing by their sequence numbers.
  [[nodiscard]] std::uint64_t lost() const { return lost_; }
  /// Samples that were measured no later than one before them.
  [[nodiscard]] std::uint64_t out_of_order() const { return out_of_order_; }
  /// By the times of measurement; 0 for fewer than two samples.
  [[nodiscard]] double rate_hz() const;
  /// From measurement to arrival, in seconds.
  [[nodiscard]] const RunningNumbers& latency_s() const { return latency_s_; }
  /// From arrival to arrival, in seconds; its deviation is the jitter, its maximum the longest gap.
  [[nodiscard]] const RunningNumbers& interval_s() const { return interval_s_; }
  /// From the first measurement to the last.
  [[nodiscard]] Duration duration() const;
  [[nodiscard]] const std::optional<tracking::PoseSample>& newest() const { return newest_; }

 private:
  std::uint64_t samples_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t out_of_order_ = 0;
  std::uint64_t highest_ = 0;  // sequence number
  RunningNumbers latency_s_;
  RunningNumbers interval_s_;
  Time first_;
  Time last_;  // measured latest
  Time last_arrival_;
  std::optional<tracking::PoseSample> newest_;  // came last
};

}  // namespace veneer::cli
