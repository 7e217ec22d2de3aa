// SPDX-License-Identifier: Apache-2.0
#include "tracking/device/clock_mapper.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>

#include "base/result.h"

namespace veneer::tracking {
namespace {

constexpr double kWindow_s = 4;
constexpr double kMostSkew = 500e-6;
/// Points nearer than this say nothing of the slope.
constexpr double kSkewSpan_s = 0.4;
/// What the least delay of a bin may lie above the envelope for no better reason than jitter.
constexpr double kJitter_s = 0.3e-3;
constexpr double kSlew = 200e-6;  // seconds a second
/// How far from the envelope a sample's clock may seem to be ahead of its arrival, or behind the
/// sample before, until it counts as another clock.
constexpr double kMisfit_s = 0.05;
/// Of the shortest delays of four runs of samples, for the clock to be locked.
constexpr double kLockSpread_s = 1e-3;

/// The height at device time 0 of the highest line of this slope under all points.
double height_of(std::span<const ClockBin> points, double slope) {
  double height = std::numeric_limits<double>::infinity();
  for (const ClockBin& point : points) {
    height = std::min(height, point.offset_s - slope * point.device_s);
  }
  return height;
}

/// Height and slope of the line under all points that is nearest to them in the sum: it rests on
/// two of them. `slope` where no two are far enough apart.
std::pair<double, double> line_under(std::span<const ClockBin> points, double slope) {
  double mean_s = 0;
  for (const ClockBin& point : points)
    mean_s += point.device_s / static_cast<double>(points.size());
  std::pair<double, double> best{height_of(points, slope), slope};
  double highest = -std::numeric_limits<double>::infinity();
  for (const ClockBin& a : points) {
    for (const ClockBin& b : points) {
      if (b.device_s - a.device_s < kSkewSpan_s) continue;
      const double through =
          std::clamp((b.offset_s - a.offset_s) / (b.device_s - a.device_s), -kMostSkew, kMostSkew);
      // The sum of the distances is least where the line is highest at the mean time.
      const double height = height_of(points, through);
      if (height + through * mean_s <= highest) continue;
      highest = height + through * mean_s;
      best = {height, through};
    }
  }
  return best;
}

/// The slope of least squares through the points near a line; the line's own where these are
/// too near to one another.
double slope_through(std::span<const ClockBin> points, double height, double slope) {
  const auto near = [height, slope](const ClockBin& point) {
    return point.offset_s - (height + slope * point.device_s) < kJitter_s;
  };
  double count = 0;
  double mean_t = 0;
  double mean_o = 0;
  for (const ClockBin& point : points) {
    if (!near(point)) continue;
    count += 1;
    mean_t += (point.device_s - mean_t) / count;
    mean_o += (point.offset_s - mean_o) / count;
  }
  double tt = 0;
  double to = 0;
  double first = std::numeric_limits<double>::infinity();
  double last = -first;
  for (const ClockBin& point : points) {
    if (!near(point)) continue;
    tt += (point.device_s - mean_t) * (point.device_s - mean_t);
    to += (point.device_s - mean_t) * (point.offset_s - mean_o);
    first = std::min(first, point.device_s);
    last = std::max(last, point.device_s);
  }
  return last - first < kSkewSpan_s ? slope : std::clamp(to / tt, -kMostSkew, kMostSkew);
}

}  // namespace

std::int64_t widen(WrappingCounter counter, std::uint64_t raw, std::optional<std::int64_t> last) {
  const int spare = 64 - counter.bits;
  if (!last) return static_cast<std::int64_t>((raw << spare) >> spare);
  // The difference, taken modulo the wrap and with its sign. All sums wrap as the unsigned do: a
  // hostile 64-bit counter may be anywhere.
  const std::uint64_t difference = (raw - static_cast<std::uint64_t>(*last)) << spare;
  const std::int64_t step = static_cast<std::int64_t>(difference) >> spare;
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(*last) +
                                   static_cast<std::uint64_t>(step));
}

ClockMapper::ClockMapper(const DeviceClock& clock) : clock_(clock) {
  VENEER_CHECK(clock.seconds_per_tick > 0 && clock.counter.bits >= 1 && clock.counter.bits <= 64);
}

void ClockMapper::reset() { *this = ClockMapper(clock_); }

double ClockMapper::envelope(double device_s) const { return base_s_ + skew_ * device_s; }

void ClockMapper::learn(double device_s, double offset_s) {
  const auto number = static_cast<std::int64_t>(std::floor(device_s / (kWindow_s / kBins)));
  ClockBin& bin = bins_[static_cast<std::size_t>(number) % kBins];
  if (bin.number != number) {
    if (number < bin.number) return;  // late by more than the window
    bin = {number, device_s, offset_s};
  } else if (offset_s - skew_ * device_s < bin.offset_s - skew_ * bin.device_s) {
    bin.device_s = device_s;
    bin.offset_s = offset_s;
  }
  fit_envelope();
}

void ClockMapper::fit_envelope() {
  const std::int64_t newest = std::ranges::max_element(bins_, {}, &ClockBin::number)->number;
  std::array<ClockBin, kBins> minima;
  const auto end =
      std::ranges::copy_if(bins_, minima.begin(), [newest](const ClockBin& bin) {
        return bin.number >= 0 && bin.number + static_cast<std::int64_t>(kBins) > newest;
      }).out;
  const std::span<const ClockBin> points(minima.begin(), end);
  std::tie(base_s_, skew_) = line_under(points, skew_);
  // The line rests on two points; the others that lie on it, but for their jitter, know its slope
  // better.
  skew_ = slope_through(points, base_s_, skew_);
  base_s_ = height_of(points, skew_);
}

void ClockMapper::try_to_lock(double offset_s) {
  run_minimum_s_ = run_samples_ == 0 ? offset_s : std::min(run_minimum_s_, offset_s);
  if (++run_samples_ < kRun) return;
  run_samples_ = 0;
  run_minima_[runs_++ % kRuns] = run_minimum_s_;
  if (runs_ < kRuns) return;
  const auto [least, most] = std::ranges::minmax(run_minima_);
  locked_ = most - least < kLockSpread_s;
}

bool ClockMapper::misfits(double device_s, double offset_s) const {
  const bool ahead = offset_s < envelope(device_s) - kMisfit_s;
  const bool back = device_s < newest_device_s_ - kMisfit_s;
  return ahead || back;
}

ClockMapper::Mapped ClockMapper::map(std::uint64_t ticks, Time arrival) {
  const std::int64_t wide = widen(clock_.counter, ticks, newest_ticks_);
  const bool first = !first_ticks_;
  if (first) {
    first_ticks_ = wide;
    first_arrival_ = arrival;
  }
  // In double precision: what a difference of 2^63 ticks loses there does not matter.
  const double device_s =
      (static_cast<double>(wide) - static_cast<double>(*first_ticks_)) * clock_.seconds_per_tick;
  const double offset_s = to_seconds(arrival - first_arrival_) - device_s;

  if (!first && misfits(device_s, offset_s)) {
    const bool agrees =
        outlier_device_s_ && device_s >= *outlier_device_s_ &&
        device_s - *outlier_device_s_ <= to_seconds(arrival - outlier_arrival_) + kMisfit_s;
    if (!agrees) {
      outlier_device_s_ = device_s;
      outlier_arrival_ = arrival;
      return {Verdict::kOutlier, {}, locked_};
    }
    reset();
    Mapped mapped = map(ticks, arrival);
    mapped.verdict = Verdict::kRestarted;
    return mapped;
  }
  outlier_device_s_.reset();

  newest_ticks_ = first ? wide : std::max(wide, *newest_ticks_);
  newest_device_s_ = std::max(newest_device_s_, device_s);
  learn(device_s, offset_s);
  if (locked_ && envelope(device_s) - applied_s_ > kMisfit_s) {
    // Everything has been late for the whole window: the clock was set back, or stood still, while
    // nobody looked. Slewing there would take hours.
    reset();
    Mapped mapped = map(ticks, arrival);
    mapped.verdict = Verdict::kRestarted;
    return mapped;
  }
  if (locked_) {
    // Follows the slope, and goes the rest of the way to the envelope as fast as it may.
    const double passed_s = device_s - applied_at_s_;
    const double followed_s = applied_s_ + skew_ * passed_s;
    const double most_s = kSlew * std::max(0.0, passed_s);
    applied_s_ = followed_s + std::clamp(envelope(device_s) - followed_s, -most_s, most_s);
  } else {
    applied_s_ = envelope(device_s);
    try_to_lock(offset_s);
  }
  applied_at_s_ = device_s;
  const Time time = first_arrival_ + from_seconds(device_s + applied_s_);
  return {Verdict::kMapped, std::min(time, arrival), locked_};
}

}  // namespace veneer::tracking
