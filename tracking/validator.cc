// SPDX-License-Identifier: Apache-2.0
#include "tracking/validator.h"

#include <cmath>

#include "base/units.h"

namespace veneer::tracking {
namespace {

/// The angle between two rotations whose quaternions are of unit length within 10 %: 0 to pi.
double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond turn = a.conjugate() * b;
  return 2 * std::atan2(turn.vec().norm(), std::abs(turn.w()));
}

void read_limit(TomlReader& toml, std::string_view key, double& value, bool zero_is_good) {
  toml.read(key, value);
  if (!(zero_is_good ? value >= 0 : value > 0) || !std::isfinite(value)) {
    toml.add_error(key, fmt::format("{} is not {} 0", value, zero_is_good ? "at least" : "above"));
  }
}

}  // namespace

ValidationOptions ValidationOptions::read(TomlReader& toml) {
  ValidationOptions options;
  read_limit(toml, "speed_m_s", options.speed_m_s, false);
  read_limit(toml, "turn_rad_s", options.turn_rad_s, false);
  read_limit(toml, "tolerance_mm", options.tolerance_mm, true);
  read_limit(toml, "tolerance_deg", options.tolerance_deg, true);
  if (toml.contains("least_m") || toml.contains("most_m")) {
    Eigen::Vector3d least = Eigen::Vector3d::Zero();
    Eigen::Vector3d most = Eigen::Vector3d::Zero();
    toml.require("least_m", least);
    toml.require("most_m", most);
    if (!(least.array() < most.array()).all()) {
      toml.add_error("least_m", "is not below most_m in every coordinate");
    }
    options.least_m = least;
    options.most_m = most;
  }
  return options;
}

bool Validator::is_pose(const PoseSample& sample) const {
  const Eigen::Vector3d& position = sample.world_from_body.translation;
  const double length = sample.world_from_body.rotation.norm();
  constexpr double kFarthest_m = 1e6;  // keeps differences and their squares finite
  if (!(position.cwiseAbs().array() <= kFarthest_m).all()) return false;
  if (!(length >= 0.9 && length <= 1.1)) return false;
  if (options_.least_m && !(position.array() >= options_.least_m->array()).all()) return false;
  return !options_.most_m || (position.array() <= options_.most_m->array()).all();
}

bool Validator::reaches(const PoseSample& from, const PoseSample& to) const {
  const double passed_s = std::abs(to_seconds(to.time - from.time));
  const double way_m = (to.world_from_body.translation - from.world_from_body.translation).norm();
  const double turn_rad = angle_between(from.world_from_body.rotation, to.world_from_body.rotation);
  return way_m <= options_.speed_m_s * passed_s + 1e-3 * options_.tolerance_mm &&
         turn_rad <=
             options_.turn_rad_s * passed_s + to_radians(Degrees{options_.tolerance_deg}).value;
}

Validator::Verdict Validator::check(PoseSample& sample) {
  if (!is_pose(sample)) return Verdict::kInvalid;
  if (believed_ && !reaches(*believed_, sample)) {
    if (!outlier_ || !reaches(*outlier_, sample)) {
      outlier_ = sample;
      return Verdict::kOutlier;
    }
    ++jumps_;
  }
  believed_ = sample;
  outlier_.reset();
  sample.epoch += jumps_;
  return Verdict::kValid;
}

}  // namespace veneer::tracking
