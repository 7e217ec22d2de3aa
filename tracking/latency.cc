// SPDX-License-Identifier: Apache-2.0
#include "tracking/latency.h"

#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace veneer::tracking {
namespace {

constexpr std::size_t kParts = 10;  // of the recording, left out in turn
/// At most so many moments are compared, at least so far apart: they are known to be smooth.
constexpr double kMostMoments = 3000;
constexpr double kLeastStep_s = 0.004;
/// Between the latencies that are tried first. What was smoothed over 2 * 25 ms does not hide in
/// between.
constexpr double kCoarse_s = 0.004;
/// Half the width of the parabolas that find the minimum in the end, the last one first.
constexpr std::array kFine_s{0.004, 0.001, 0.001};
/// The first search makes do with every so manieth moment.
constexpr std::size_t kCoarseStride = 4;
constexpr double kLeastCommon_s = 1;

template <int N>
using Vector = Eigen::Matrix<double, N, 1>;

/// Sums over pairs of points, from which follows how well one set of them turns into the other.
template <int N>
struct Moments {
  double count = 0;
  Vector<N> a = Vector<N>::Zero();
  Vector<N> b = Vector<N>::Zero();
  double squares = 0;
  Eigen::Matrix<double, N, N> cross = Eigen::Matrix<double, N, N>::Zero();

  void add(const Vector<N>& from, const Vector<N>& to) {
    count += 1;
    a += from;
    b += to;
    squares += from.squaredNorm() + to.squaredNorm();
    cross += from * to.transpose();
  }
  void add(const Moments& other, double sign) {
    count += sign * other.count;
    a += sign * other.a;
    b += sign * other.b;
    squares += sign * other.squares;
    cross += sign * other.cross;
  }
  /// The mean square of what is left after the best turn and shift.
  [[nodiscard]] double left_over() const {
    if (!(count > 0)) return 0;
    const Eigen::Matrix<double, N, N> centred = cross - a * b.transpose() / count;
    const Eigen::JacobiSVD<Eigen::Matrix<double, N, N>> svd(centred);
    if (svd.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    double match = svd.singularValues().sum();
    if (centred.determinant() < 0) match -= 2 * svd.singularValues()[N - 1];  // no mirror images
    const double spread = squares - (a.squaredNorm() + b.squaredNorm()) / count;
    return std::max(0.0, (spread - 2 * match) / count);
  }
};

/// Moments of both signals at one latency, for every part of the recording.
struct Comparison {
  std::array<Moments<3>, kParts> positions;
  std::array<Moments<4>, kParts> rotations;
};

template <int N>
double left_over(const std::array<Moments<N>, kParts>& parts, std::size_t without = kParts) {
  Moments<N> sum;
  for (std::size_t part = 0; part < kParts; ++part) {
    if (part != without) sum.add(parts[part], 1);
  }
  return sum.left_over();
}

double left_over(const Comparison& comparison, MotionSignal signal, std::size_t without = kParts) {
  return signal == MotionSignal::kPosition ? left_over(comparison.positions, without)
                                           : left_over(comparison.rotations, without);
}

struct Moment {
  Time time;
  std::size_t part = 0;
  PoseHistory::LocalFit reference;
};

/// The reference at moments at which it is known, far enough from the ends of the tracker's history
/// for every latency.
std::vector<Moment> moments_of(const PoseHistory& tracker,
                               const PoseHistory& reference,
                               const LatencyOptions& options) {
  if (tracker.samples().empty() || reference.samples().empty()) return {};
  const Duration margin = from_seconds(options.most_s + kCoarse_s);
  const Time from =
      std::max(tracker.samples().front().time + margin, reference.samples().front().time);
  const Time to = std::min(tracker.samples().back().time - margin, reference.samples().back().time);
  const double span_s = to_seconds(to - from);
  if (!(span_s >= kLeastCommon_s)) return {};
  const double step_s = std::max(kLeastStep_s, span_s / kMostMoments);
  std::vector<Moment> moments;
  for (double at_s = 0; at_s < span_s; at_s += step_s) {
    const Time time = from + from_seconds(at_s);
    const auto fit = reference.fit_at(time, from_seconds(options.smoothing_s));
    const auto part = static_cast<std::size_t>(kParts * at_s / span_s);
    if (fit) moments.push_back({time, std::min(part, kParts - 1), *fit});
  }
  return moments;
}

Comparison compare(const std::vector<Moment>& moments,
                   const PoseHistory& tracker,
                   double latency_s,
                   Duration smoothing,
                   std::size_t stride) {
  Comparison comparison;
  for (std::size_t i = 0; i < moments.size(); i += stride) {
    const Moment& moment = moments[i];
    const auto fit = tracker.fit_at(moment.time + from_seconds(latency_s), smoothing);
    if (!fit) continue;
    comparison.positions[moment.part].add(fit->position, moment.reference.position);
    comparison.rotations[moment.part].add(fit->rotation, moment.reference.rotation);
  }
  return comparison;
}

/// Where the parabola through values at -1, 0 and 1 is lowest; nothing where it is not.
std::optional<double> lowest(double before, double middle, double after) {
  const double curvature = before - 2 * middle + after;
  if (!(curvature > 0)) return std::nullopt;
  return (before - after) / (2 * curvature);
}

class Search {
 public:
  Search(const PoseHistory& tracker, std::vector<Moment> moments, const LatencyOptions& options)
      : tracker_(tracker),
        moments_(std::move(moments)),
        smoothing_(from_seconds(options.smoothing_s)),
        steps_(static_cast<int>(std::ceil(options.most_s / kCoarse_s))) {
    for (int step = -steps_; step <= steps_; ++step)
      coarse_.push_back(compared_at(step * kCoarse_s, kCoarseStride));
  }

  [[nodiscard]] Latency run(MotionSignal signal) const {
    std::vector<double> left;
    for (const Comparison& comparison : coarse_) left.push_back(left_over(comparison, signal));
    const auto best = std::min_element(left.begin(), left.end());
    const auto index = static_cast<int>(best - left.begin());

    Latency latency;
    latency.signal = signal;
    latency.latency_s = (index - steps_) * kCoarse_s;
    latency.at_edge = index == 0 || index == 2 * steps_;
    latency.residual = scale(signal) * std::sqrt(*best);
    latency.worst_residual = scale(signal) * std::sqrt(*std::max_element(left.begin(), left.end()));
    latency.deviation_s = kUnknown_s;
    std::optional<Latency> rival;
    for (int i = 1; i + 1 < static_cast<int>(left.size()); ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (i == index || left[at] > left[at - 1] || left[at] > left[at + 1]) continue;
      const double residual = scale(signal) * std::sqrt(left[at]);
      if (rival && rival->residual <= residual) continue;
      rival = latency;
      rival->latency_s = (i - steps_) * kCoarse_s;
      rival->residual = residual;
    }
    if (rival) {
      refine(*rival);
      latency.rival_residual = rival->residual;
    }
    if (!latency.at_edge) refine(latency);
    return latency;
  }

 private:
  /// More than any latency that is looked for.
  static constexpr double kUnknown_s = 10;

  [[nodiscard]] Comparison compared_at(double latency_s, std::size_t stride) const {
    return compare(moments_, tracker_, latency_s, smoothing_, stride);
  }
  /// A quaternion moves by half the angle.
  static double scale(MotionSignal signal) { return signal == MotionSignal::kRotation ? 2 : 1; }

  void refine(Latency& latency) const {
    std::array<Comparison, 3> around;
    double middle_s = latency.latency_s;
    double half_s = 0;
    for (const double width_s : kFine_s) {
      middle_s = latency.latency_s;
      half_s = width_s;
      for (int i = 0; i < 3; ++i)
        around[static_cast<std::size_t>(i)] = compared_at(middle_s + (i - 1) * half_s, 1);
      const auto vertex = lowest_of(around, latency.signal, kParts);
      if (!vertex) return;
      latency.latency_s = middle_s + std::clamp(*vertex, -1.0, 1.0) * half_s;
    }
    latency.residual = scale(latency.signal) * std::sqrt(left_over(around[1], latency.signal));
    // As for the eye's offset: Shao and Wu 1989, leaving out groups.
    std::array<double, kParts> without{};
    double mean_s = 0;
    for (std::size_t part = 0; part < kParts; ++part) {
      const auto vertex = lowest_of(around, latency.signal, part);
      if (!vertex) return;
      without[part] = *vertex * half_s;
      mean_s += without[part] / kParts;
    }
    double squares = 0;
    for (const double each : without) squares += (each - mean_s) * (each - mean_s);
    latency.deviation_s = std::sqrt(squares * (kParts - 1.0) / kParts);
  }

  [[nodiscard]] static std::optional<double> lowest_of(const std::array<Comparison, 3>& around,
                                                       MotionSignal signal,
                                                       std::size_t without) {
    return lowest(left_over(around[0], signal, without),
                  left_over(around[1], signal, without),
                  left_over(around[2], signal, without));
  }

  const PoseHistory& tracker_;
  std::vector<Moment> moments_;
  Duration smoothing_;
  int steps_;
  std::vector<Comparison> coarse_;
};

bool convincing(const Latency& latency) {
  const LatencyLimits limits;
  const bool by_position = latency.signal == MotionSignal::kPosition;
  return latency.worst_residual >= limits.least_contrast * latency.residual &&
         latency.worst_residual >= (by_position ? limits.least_move_m : limits.least_turn_rad);
}

}  // namespace

std::string_view name_of(MotionSignal signal) {
  return signal == MotionSignal::kPosition ? "position" : "rotation";
}

Result<Latency> measure_latency(const PoseHistory& tracker,
                                const PoseHistory& reference,
                                const LatencyOptions& options) {
  if (!(options.most_s > 0 && options.most_s <= 2)) {
    return fail(Errc::kInvalidOption,
                "the largest latency to try is {} s: choose a number above 0, at most 2",
                options.most_s);
  }
  if (!(options.smoothing_s > 0 && options.smoothing_s <= 0.5)) {
    return fail(Errc::kInvalidOption,
                "the smoothing is {} s: choose a number above 0, at most 0.5",
                options.smoothing_s);
  }
  std::vector<Moment> moments = moments_of(tracker, reference, options);
  if (moments.size() < kParts) {
    return fail(Errc::kBadFormat,
                "measuring the latency: the recordings have less than {} s in common, {} s at "
                "either end aside; record both at the same time on the same machine, at four "
                "samples or more in {} ms",
                kLeastCommon_s,
                options.most_s,
                2e3 * options.smoothing_s);
  }
  const double seconds = to_seconds(moments.back().time - moments.front().time);
  const Search search(tracker, std::move(moments), options);
  Latency by_position = search.run(MotionSignal::kPosition);
  Latency by_rotation = search.run(MotionSignal::kRotation);
  const bool position_is_better = convincing(by_position) != convincing(by_rotation)
                                      ? convincing(by_position)
                                      : by_position.deviation_s <= by_rotation.deviation_s;
  Latency latency = position_is_better ? by_position : by_rotation;
  latency.seconds = seconds;
  return latency;
}

Status check(const Latency& latency, const LatencyLimits& limits) {
  constexpr std::string_view kDoing = "measuring the latency";
  if (!(latency.seconds >= limits.least_seconds)) {
    return fail(Errc::kUnavailable,
                "{}: {:.1f} s of motion are common to both recordings, at least {:g} are needed",
                kDoing,
                latency.seconds,
                limits.least_seconds);
  }
  const bool by_position = latency.signal == MotionSignal::kPosition;
  const double least = by_position ? limits.least_move_m : limits.least_turn_rad;
  if (!(latency.worst_residual >= least)) {
    return fail(Errc::kUnavailable,
                "{}: even the worst latency leaves only {:.2g} {} between the motions, at least "
                "{:g} are needed; move the thing fast and unevenly, to and fro and about several "
                "axes",
                kDoing,
                latency.worst_residual,
                by_position ? "m" : "rad",
                least);
  }
  if (!(latency.worst_residual >= limits.least_contrast * latency.residual)) {
    return fail(Errc::kUnavailable,
                "{}: the worst latency fits {:.1f} times as badly as the best, at least {:g} times "
                "is needed; move the thing fast and unevenly, to and fro and about several axes, "
                "and see that both recordings are of the same thing",
                kDoing,
                latency.residual > 0 ? latency.worst_residual / latency.residual : 1.0,
                limits.least_contrast);
  }
  if (latency.at_edge) {
    return fail(Errc::kUnavailable,
                "{}: the best of the latencies tried is the last one, {:.0f} ms; try larger ones, "
                "and see that both recordings are of the same motion",
                kDoing,
                1e3 * latency.latency_s);
  }
  if (latency.rival_residual &&
      !(*latency.rival_residual >= limits.least_rival * latency.residual)) {
    return fail(Errc::kUnavailable,
                "{}: another latency fits only {:.2f} times as badly, at least {:g} times is "
                "needed; the motion repeats itself: move unevenly",
                kDoing,
                *latency.rival_residual / latency.residual,
                limits.least_rival);
  }
  if (!(latency.deviation_s <= limits.most_deviation_s)) {
    return fail(
        Errc::kUnavailable,
        "{}: it is known to {:.2f} ms only, {:g} ms are needed; move faster, and for longer",
        kDoing,
        1e3 * latency.deviation_s,
        1e3 * limits.most_deviation_s);
  }
  return {};
}

}  // namespace veneer::tracking
