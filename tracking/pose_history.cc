// SPDX-License-Identifier: Apache-2.0
#include "tracking/pose_history.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "tracking/recording.h"

namespace veneer::tracking {
namespace {

/// One more than a line and its spread need.
constexpr int kFewest = 4;

}  // namespace

bool PoseHistory::add(const PoseSample& sample) {
  const double length = sample.world_from_body.rotation.norm();
  const bool good = sample.world_from_body.translation.allFinite() && length >= 0.9 &&
                    length <= 1.1 && (samples_.empty() || sample.time > samples_.back().time);
  if (!good) {
    ++dropped_;
    return false;
  }
  PoseSample taken = sample;
  Eigen::Quaterniond& rotation = taken.world_from_body.rotation;
  rotation.coeffs() /= length;
  if (!samples_.empty() && rotation.dot(samples_.back().world_from_body.rotation) < 0)
    rotation.coeffs() *= -1;
  samples_.push_back(taken);
  return true;
}

std::optional<PoseHistory::LocalFit> PoseHistory::fit_at(Time when, Duration half_width) const {
  const auto before = [](const PoseSample& sample, Time time) { return sample.time < time; };
  const auto first = std::lower_bound(samples_.begin(), samples_.end(), when - half_width, before);
  const auto last = std::lower_bound(first, samples_.end(), when + half_width, before);
  if (last - first < kFewest || first->time > when || (last - 1)->time < when ||
      first->epoch != (last - 1)->epoch)
    return std::nullopt;

  // Position and rotation as one vector, relative to the first sample: far from the origin, sums
  // of squares would lose what is small.
  using Vector7d = Eigen::Matrix<double, 7, 1>;
  const auto values_of = [](const PoseSample& sample) {
    Vector7d values;
    values << sample.world_from_body.translation, sample.world_from_body.rotation.coeffs();
    return values;
  };
  const Vector7d origin = values_of(*first);
  const double width_s = to_seconds(half_width);
  const auto time_of = [&](const PoseSample& sample) { return to_seconds(sample.time - when); };
  const auto weight_of = [&](double time_s) {
    const double part = time_s / width_s;
    return (1 - part * part) * (1 - part * part);
  };

  double sum = 0;
  double sum_t = 0;
  double sum_tt = 0;
  Vector7d sum_v = Vector7d::Zero();
  Vector7d sum_tv = Vector7d::Zero();
  for (auto sample = first; sample != last; ++sample) {
    const double time_s = time_of(*sample);
    const double weight = weight_of(time_s);
    const Vector7d value = values_of(*sample) - origin;
    sum += weight;
    sum_t += weight * time_s;
    sum_tt += weight * time_s * time_s;
    sum_v += weight * value;
    sum_tv += weight * time_s * value;
  }
  const double determinant = sum * sum_tt - sum_t * sum_t;
  if (!(determinant > 1e-9 * sum * sum * width_s * width_s)) return std::nullopt;
  const Vector7d value = (sum_tt * sum_v - sum_t * sum_tv) / determinant;
  const Vector7d slope = (sum * sum_tv - sum_t * sum_v) / determinant;

  Vector7d squares = Vector7d::Zero();
  double gain = 0;
  for (auto sample = first; sample != last; ++sample) {
    const double time_s = time_of(*sample);
    const double weight = weight_of(time_s);
    const Vector7d off = values_of(*sample) - origin - value - time_s * slope;
    squares += weight * off.cwiseAbs2();
    const double share = weight * (sum_tt - time_s * sum_t) / determinant;
    gain += share * share;
  }
  LocalFit fit;
  fit.samples = static_cast<int>(last - first);
  fit.position = (origin + value).head<3>();
  fit.rotation = (origin + value).tail<4>();
  fit.speed_m_s = slope.head<3>().norm();
  fit.turning_rad_s = 2 * slope.tail<4>().norm();  // a quaternion holds half the angle
  const double per_sample = fit.samples / (sum * (fit.samples - 2));
  fit.position_spread_m = std::sqrt(squares.head<3>().sum() * per_sample / 3);
  // Three of the four components are free.
  fit.rotation_spread_rad = 2 * std::sqrt(squares.tail<4>().sum() * per_sample / 3);
  fit.gain = std::sqrt(gain);
  return fit;
}

Result<std::map<BodyId, PoseHistory>> read_histories(const std::filesystem::path& recording) {
  VENEER_ASSIGN(PoseRecordingReader reader, PoseRecordingReader::open(recording));
  std::map<BodyId, PoseHistory> histories;
  while (true) {
    VENEER_ASSIGN(const std::optional<PoseSample> sample, reader.next());
    if (!sample) return histories;
    histories[sample->body].add(*sample);
  }
}

Result<PoseHistory> read_history(const std::filesystem::path& recording, BodyId body) {
  VENEER_ASSIGN(auto histories, read_histories(recording));
  const auto found = histories.find(body);
  if (found != histories.end()) return std::move(found->second);
  std::string others;
  for (const auto& [other, history] : histories)
    others += fmt::format("{}{}", others.empty() ? "" : ", ", other);
  return fail(Errc::kNotFound,
              "{}: no sample of body {}; {}",
              recording.string(),
              body,
              others.empty() ? "the recording is empty" : "the bodies in it are " + others);
}

}  // namespace veneer::tracking
