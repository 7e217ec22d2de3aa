// SPDX-License-Identifier: Apache-2.0
#include "tracking/pose_track.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace veneer::tracking {
namespace {

/// Farther out than any room; keeps products of coordinates finite.
constexpr double kFarthest_m = 1e6;
/// Two samples closer than this differ by noise more than by motion: no velocity comes from them.
constexpr double kShortestSpan_s = 0.5e-3;
/// How far back the sample before the newest may lie to be used outside the velocity window.
constexpr double kLongestGap_s = 0.2;
/// The ring holds this much at the highest rate, that of the fastest simulated tracker.
constexpr double kLongestWindow_s = 0.1;
constexpr double kFastestTracker_hz = 10000;
/// Velocities that have decayed to this part count as gone.
constexpr double kNothingLeft = 0.05;
/// A query starts again when the writer has gone over the whole ring in the middle of it, which
/// takes it 1024 samples; it does so at most this often.
constexpr int kAttempts = 4;

/// later - earlier in seconds, for any two times.
double seconds_between(Time earlier, Time later) {
  Duration::rep difference = 0;
  if (!__builtin_sub_overflow(
          later.time_since_epoch().count(), earlier.time_since_epoch().count(), &difference)) {
    return to_seconds(Duration{difference});
  }
  return to_seconds(later.time_since_epoch()) - to_seconds(earlier.time_since_epoch());
}

/// later - earlier, at most what a Duration holds.
Duration clamped_difference(Time earlier, Time later) {
  Duration::rep difference = 0;
  if (__builtin_sub_overflow(
          later.time_since_epoch().count(), earlier.time_since_epoch().count(), &difference)) {
    return later > earlier ? Duration::max() : Duration::min();
  }
  return Duration{difference};
}

/// The rotation vector (axis times angle, at most pi) of a unit quaternion.
Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;  // q and -q are one rotation; take the shorter way
  const double sine = q.vec().norm();          // of half the angle
  // Below this 2 atan2(s, c) / s is 2 to the last bit.
  const double scale = sine < 1e-9 ? 2.0 : 2.0 * std::atan2(sine, sign * q.w()) / sine;
  return sign * scale * q.vec();
}

/// The unit quaternion of a rotation vector.
Eigen::Quaterniond quaternion(const Eigen::Vector3d& rotation_vector_rad) {
  const double half = 0.5 * rotation_vector_rad.norm();
  const double scale = half < 1e-9 ? 0.5 : 0.5 * std::sin(half) / half;
  Eigen::Quaterniond q;
  q.w() = std::cos(half);
  q.vec() = scale * rotation_vector_rad;
  return q;
}

/// The straight line of least squares through points (time, vector), times relative to one of them.
class LineFit {
 public:
  void add(double time_s, const Eigen::Vector3d& value) {
    count_ += 1;
    sum_t_ += time_s;
    sum_tt_ += time_s * time_s;
    sum_v_ += value;
    sum_tv_ += time_s * value;
  }
  /// Needs two different times.
  [[nodiscard]] Eigen::Vector3d slope() const {
    return (count_ * sum_tv_ - sum_t_ * sum_v_) / (count_ * sum_tt_ - sum_t_ * sum_t_);
  }

 private:
  double count_ = 0;
  double sum_t_ = 0;
  double sum_tt_ = 0;
  Eigen::Vector3d sum_v_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum_tv_ = Eigen::Vector3d::Zero();
};

bool in_range(double value, double low, double high) { return value >= low && value <= high; }

}  // namespace

Status PredictionOptions::check() const {
  if (!in_range(horizon_s, 0, 0.2)) {
    return fail(Errc::kInvalidOption, "horizon_s is {}: choose 0 to 0.2", horizon_s);
  }
  if (!(decay_s > 0) || !std::isfinite(decay_s)) {
    return fail(Errc::kInvalidOption, "decay_s is {}: choose a number above 0", decay_s);
  }
  if (!(velocity_window_s > 0) || !(velocity_window_s <= kLongestWindow_s)) {
    return fail(Errc::kInvalidOption,
                "velocity_window_s is {}: choose a number above 0, at most {}",
                velocity_window_s,
                kLongestWindow_s);
  }
  return {};
}

PoseTrack::PoseTrack(const PredictionOptions& options) : options_(options) {
  static_assert(kLongestWindow_s * kFastestTracker_hz < kSlots - 1,
                "the ring holds a whole window while its oldest sample is being replaced");
  VENEER_CHECK(options.check().has_value());
}

PoseTrack::Verdict PoseTrack::add(const PoseSample& sample) {
  const Eigen::Vector3d& position = sample.world_from_body.translation;
  const double length = sample.world_from_body.rotation.norm();
  // Written so that NaN fails.
  if (!(position.cwiseAbs().array() <= kFarthest_m).all() || !in_range(length, 0.9, 1.1)) {
    return Verdict::kInvalid;
  }
  const bool first = published_.load(std::memory_order_relaxed) == 0;
  if (!first && sample.sequence == newest_.sequence) return Verdict::kDuplicate;
  if (!first && sample.time <= newest_.time) return Verdict::kLate;

  PoseSample taken = sample;
  Eigen::Quaterniond& rotation = taken.world_from_body.rotation;
  rotation.coeffs() /= length;
  if (!first && rotation.dot(newest_.world_from_body.rotation) < 0) rotation.coeffs() *= -1;
  newest_ = taken;
  TimedPose pose{taken.time, taken.world_from_body, taken.epoch, {}};
  pose.rates = fit_rates(pose, published_.load(std::memory_order_relaxed));
  publish(pose);
  return Verdict::kTaken;
}

// The hand-off is a sequence lock per slot whose payload words are atomics themselves, so that
// there is no data race by the letter of the language. Payload stores release and payload loads
// acquire: whoever sees one word of a newer sample then also sees its odd stamp, with no fence
// (which the thread sanitizer would not understand). On x86 all of these are plain moves. Source:
// Boehm 2012, "Can Seqlocks Get Along With Programming Language Memory Models?".
void PoseTrack::publish(const TimedPose& pose) {
  const std::uint64_t index = published_.load(std::memory_order_relaxed);
  const Eigen::Vector3d& p = pose.world_from_body.translation;
  const Eigen::Quaterniond& q = pose.world_from_body.rotation;
  const Eigen::Vector3d& v = pose.rates.velocity;
  const Eigen::Vector3d& w = pose.rates.angular_velocity;
  const std::array<double, kNumbers> numbers{
      p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(), v.x(), v.y(), v.z(), w.x(), w.y(), w.z()};

  Slot& slot = slots_[index % kSlots];
  slot.stamp.store(2 * index + 1, std::memory_order_relaxed);
  slot.words[0].store(static_cast<std::uint64_t>(pose.time.time_since_epoch().count()),
                      std::memory_order_release);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    slot.words[i + 1].store(std::bit_cast<std::uint64_t>(numbers[i]), std::memory_order_release);
  }
  slot.words[kNumbers + 1].store(pose.epoch, std::memory_order_release);
  slot.stamp.store(2 * index + 2, std::memory_order_release);
  published_.store(index + 1, std::memory_order_release);
}

std::optional<PoseTrack::TimedPose> PoseTrack::read(std::uint64_t index) const {
  const Slot& slot = slots_[index % kSlots];
  const std::uint64_t complete = 2 * index + 2;
  if (slot.stamp.load(std::memory_order_acquire) != complete) return std::nullopt;
  const auto ticks = static_cast<Duration::rep>(slot.words[0].load(std::memory_order_acquire));
  std::array<double, kNumbers> n{};
  for (std::size_t i = 0; i < n.size(); ++i) {
    n[i] = std::bit_cast<double>(slot.words[i + 1].load(std::memory_order_acquire));
  }
  const auto epoch =
      static_cast<std::uint32_t>(slot.words[kNumbers + 1].load(std::memory_order_acquire));
  if (slot.stamp.load(std::memory_order_relaxed) != complete) return std::nullopt;
  return TimedPose{Time{Duration{ticks}},
                   {Eigen::Quaterniond(n[3], n[4], n[5], n[6]), Eigen::Vector3d(n[0], n[1], n[2])},
                   epoch,
                   {Eigen::Vector3d(n[7], n[8], n[9]), Eigen::Vector3d(n[10], n[11], n[12])}};
}

PoseEstimate PoseTrack::at(Time when) const {
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const std::uint64_t published = published_.load(std::memory_order_acquire);
    if (published == 0) return {};
    const std::optional<TimedPose> newest = read(published - 1);
    if (!newest) continue;
    return when < newest->time ? interpolate(when, *newest, published - 1) : predict(when, *newest);
  }
  return {};
}

PoseEstimate PoseTrack::interpolate(Time when, const TimedPose& newest, std::uint64_t index) const {
  PoseEstimate estimate;
  estimate.age = clamped_difference(newest.time, when);
  TimedPose later = newest;
  for (std::uint64_t back = 1; back <= std::min<std::uint64_t>(index, kSlots - 1); ++back) {
    const std::optional<TimedPose> earlier = read(index - back);
    if (!earlier) break;  // the writer has reached the old end of the history
    if (when < earlier->time) {
      later = *earlier;
      continue;
    }
    if (earlier->epoch != later.epoch) {
      later = *earlier;
      break;
    }
    const double span_s = seconds_between(earlier->time, later.time);
    const double part = seconds_between(earlier->time, when) / span_s;
    const RigidTransform& a = earlier->world_from_body;
    const RigidTransform& b = later.world_from_body;
    estimate.origin = PoseOrigin::kInterpolated;
    estimate.world_from_body = {a.rotation.slerp(part, b.rotation).normalized(),
                                a.translation + part * (b.translation - a.translation)};
    if (span_s >= kShortestSpan_s) {
      estimate.velocity = (b.translation - a.translation) / span_s;
      estimate.angular_velocity = rotation_vector(a.rotation.conjugate() * b.rotation) / span_s;
    }
    return estimate;
  }
  estimate.origin = PoseOrigin::kHeld;
  estimate.world_from_body = later.world_from_body;
  return estimate;
}

PoseEstimate PoseTrack::predict(Time when, const TimedPose& newest) const {
  const double ahead_s = seconds_between(newest.time, when);
  const double beyond_s = std::max(0.0, ahead_s - options_.horizon_s);
  // Velocities are v up to the horizon and v exp(-t / decay) beyond it; `travel_s` is the integral.
  const double left = std::exp(-beyond_s / options_.decay_s);
  const double travel_s = std::min(ahead_s, options_.horizon_s) -
                          options_.decay_s * std::expm1(-beyond_s / options_.decay_s);
  const Rates& rates = newest.rates;

  PoseEstimate estimate;
  estimate.age = clamped_difference(newest.time, when);
  if (when == newest.time) {
    estimate.origin = PoseOrigin::kInterpolated;  // it was measured
  } else {
    estimate.origin = left < kNothingLeft ? PoseOrigin::kHeld : PoseOrigin::kPredicted;
  }
  const RigidTransform& pose = newest.world_from_body;
  estimate.world_from_body = {
      (pose.rotation * quaternion(rates.angular_velocity * travel_s)).normalized(),
      pose.translation + rates.velocity * travel_s};
  estimate.velocity = rates.velocity * left;
  estimate.angular_velocity = rates.angular_velocity * left;
  return estimate;
}

PoseTrack::Rates PoseTrack::fit_rates(const TimedPose& newest, std::uint64_t index) const {
  LineFit positions;
  LineFit rotations;
  positions.add(0, Eigen::Vector3d::Zero());
  rotations.add(0, Eigen::Vector3d::Zero());
  // Rotation relative to the newest sample, summed from sample to sample, so that a window may hold
  // more than half a turn. Exact at a constant rate, whose steps all have one axis in the body
  // frame.
  Eigen::Vector3d turned = Eigen::Vector3d::Zero();
  double span_s = 0;
  Eigen::Quaterniond later = newest.world_from_body.rotation;
  for (std::uint64_t back = 1; back <= std::min<std::uint64_t>(index, kSlots - 1); ++back) {
    const std::optional<TimedPose> sample = read(index - back);
    if (!sample || sample->epoch != newest.epoch) break;
    const double ago_s = seconds_between(sample->time, newest.time);
    const bool second_of_slow_tracker = span_s < kShortestSpan_s && ago_s <= kLongestGap_s;
    if (ago_s > options_.velocity_window_s && !second_of_slow_tracker) break;
    const RigidTransform& pose = sample->world_from_body;
    turned -= rotation_vector(pose.rotation.conjugate() * later);
    positions.add(-ago_s, pose.translation - newest.world_from_body.translation);
    rotations.add(-ago_s, turned);
    span_s = ago_s;
    later = pose.rotation;
  }
  if (span_s < kShortestSpan_s) return {};
  return {positions.slope(), rotations.slope()};
}

}  // namespace veneer::tracking
