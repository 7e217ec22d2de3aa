// SPDX-License-Identifier: Apache-2.0
#include "cli/track/pose_statistics.h"

#include <algorithm>
#include <cmath>

namespace veneer::cli {

void RunningNumbers::add(double value) {
  max_ = count_ == 0 ? value : std::max(max_, value);
  ++count_;
  const double from_old_mean = value - mean_;
  mean_ += from_old_mean / static_cast<double>(count_);
  squares_ += from_old_mean * (value - mean_);
}

double RunningNumbers::deviation() const {
  return count_ < 2 ? 0 : std::sqrt(squares_ / static_cast<double>(count_ - 1));
}

void PoseStatistics::add(const tracking::PoseSample& sample, Time arrival) {
  latency_s_.add(to_seconds(arrival - sample.time));
  if (newest_) {
    interval_s_.add(to_seconds(arrival - last_arrival_));
    if (sample.sequence > highest_) {
      lost_ += sample.sequence - highest_ - 1;
    } else if (sample.sequence < highest_ && lost_ > 0) {
      --lost_;  // it was missed already and is only late
    }
    if (sample.time <= last_) ++out_of_order_;
  } else {
    first_ = last_ = sample.time;
  }
  ++samples_;
  highest_ = std::max(highest_, sample.sequence);
  last_ = std::max(last_, sample.time);
  last_arrival_ = arrival;
  newest_ = sample;
}

double PoseStatistics::rate_hz() const {
  const double seconds = to_seconds(duration());
  return seconds > 0 ? static_cast<double>(samples_ - 1) / seconds : 0;
}

Duration PoseStatistics::duration() const { return last_ - first_; }

}  // namespace veneer::cli
