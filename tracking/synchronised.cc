// SPDX-License-Identifier: Apache-2.0
#include "tracking/synchronised.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "base/units.h"

namespace veneer::tracking {
namespace {

constexpr std::size_t kParts = 5;  // of a span at rest

RigidTransform pose_of(const Eigen::Vector3d& position, const Eigen::Vector4d& rotation) {
  Eigen::Quaterniond quaternion;
  quaternion.coeffs() = rotation.normalized();
  return {quaternion, position};
}

bool all_still(std::span<const PoseHistory> histories,
               Time when,
               const SynchronisedOptions& options) {
  return std::ranges::all_of(histories, [&](const PoseHistory& history) {
    const auto fit = history.fit_at(when, from_seconds(options.speed_half_width_s));
    return fit && fit->speed_m_s <= options.still_m_s &&
           fit->turning_rad_s <= to_radians(Degrees{options.still_deg_s}).value;
  });
}

/// Nothing where a part of the span has no samples.
std::optional<SynchronisedPose> mean_of(const PoseHistory& history, Time from, Time to) {
  struct Part {
    double count = 0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  };
  std::array<Part, kParts> parts;
  SynchronisedPose pose;
  const auto first = std::ranges::lower_bound(history.samples(), from, {}, &PoseSample::time);
  for (auto sample = first; sample != history.samples().end() && sample->time <= to; ++sample) {
    const double done = to_seconds(sample->time - from) / to_seconds(to - from);
    Part& part = parts[std::min(kParts - 1, static_cast<std::size_t>(kParts * done))];
    part.count += 1;
    part.position += sample->world_from_body.translation;
    part.rotation += sample->world_from_body.rotation.coeffs();
    ++pose.samples;
  }
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  for (Part& part : parts) {
    if (part.count == 0) return std::nullopt;
    part.position /= part.count;
    part.rotation /= part.count;
    position += part.position / kParts;
    rotation += part.rotation / kParts;
  }
  double position_squares = 0;
  double rotation_squares = 0;
  for (const Part& part : parts) {
    position_squares += (part.position - position).squaredNorm();
    rotation_squares += (part.rotation - rotation).squaredNorm();
  }
  // Three coordinates; variance of a mean of parts. A quaternion moves by half the angle.
  constexpr double kTimes = 3.0 * kParts * (kParts - 1);
  pose.world_from_body = pose_of(position, rotation);
  pose.position_deviation_m = std::sqrt(position_squares / kTimes);
  pose.rotation_deviation_rad = 2 * std::sqrt(rotation_squares / kTimes);
  return pose;
}

}  // namespace

Status SynchronisedOptions::check() const {
  const std::array<std::pair<std::string_view, double>, 5> values{
      {{"half_width_s", half_width_s},
       {"speed_half_width_s", speed_half_width_s},
       {"still_m_s", still_m_s},
       {"still_deg_s", still_deg_s},
       {"least_still_s", least_still_s}}};
  for (const auto& [name, value] : values) {
    if (!(value > 0) || !std::isfinite(value))
      return fail(Errc::kInvalidOption, "{} is {}: choose a number above 0", name, value);
  }
  if (half_width_s > 0.5 || speed_half_width_s > 0.5)
    return fail(Errc::kInvalidOption, "a half width is over 0.5 s: choose at most that");
  return {};
}

std::vector<SynchronisedSample> samples_at(std::span<const PoseHistory> histories,
                                           std::span<const Time> moments,
                                           const SynchronisedOptions& options) {
  const Duration half_width = from_seconds(options.half_width_s);
  std::vector<SynchronisedSample> samples;
  for (const Time moment : moments) {
    SynchronisedSample sample{moment, 2 * half_width, {}};
    for (const PoseHistory& history : histories) {
      const auto fit = history.fit_at(moment, half_width);
      if (!fit) break;
      sample.poses.push_back({pose_of(fit->position, fit->rotation),
                              fit->gain * fit->position_spread_m,
                              fit->gain * fit->rotation_spread_rad,
                              fit->samples});
    }
    if (sample.poses.size() == histories.size()) samples.push_back(std::move(sample));
  }
  return samples;
}

std::vector<SynchronisedSample> still_samples(std::span<const PoseHistory> histories,
                                              const SynchronisedOptions& options) {
  std::vector<SynchronisedSample> samples;
  const auto finish = [&](Time from, Time to) {
    if (to - from < from_seconds(options.least_still_s)) return;
    SynchronisedSample sample{from + (to - from) / 2, to - from, {}};
    for (const PoseHistory& history : histories) {
      const auto pose = mean_of(history, from, to);
      if (!pose) return;
      sample.poses.push_back(*pose);
    }
    samples.push_back(std::move(sample));
  };
  if (histories.empty()) return samples;
  std::optional<Time> since;
  Time last;
  for (const PoseSample& sample : histories.front().samples()) {
    const bool still = all_still(histories, sample.time, options);
    if (!still && since) finish(*std::exchange(since, std::nullopt), last);
    if (!still) continue;
    if (!since) since = sample.time;
    last = sample.time;
  }
  if (since) finish(*since, last);
  return samples;
}

}  // namespace veneer::tracking
