// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated/simulated_tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/units.h"
#include "tracking/internal_arrival.h"

namespace veneer::tracking {
namespace {

Status check_range(std::string_view key, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return fail(Errc::kInvalidOption,
              "opening the simulated tracker: {} is {}; choose {} to {}",
              key,
              value,
              low,
              high);
}

Eigen::Vector3d normal_vector(Pcg32& random, double sigma) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return sigma * Eigen::Vector3d(x, y, z);
}

}  // namespace

Status SimulatedTrackerOptions::check() const {
  VENEER_TRY(check_range("rate_hz", rate_hz, 1, 10000));
  VENEER_TRY(check_range("noise_position_mm", noise_position_mm, 0, 1000));
  VENEER_TRY(check_range("noise_rotation_deg", noise_rotation_deg, 0, 90));
  return check_range("latency_ms", latency_ms, 0, 1000);
}

Result<std::unique_ptr<SimulatedTracker>> SimulatedTracker::open(TomlReader& config, Clock& clock) {
  SimulatedTrackerOptions options;
  config.read("rate_hz", options.rate_hz);
  config.read("noise_position_mm", options.noise_position_mm);
  config.read("noise_rotation_deg", options.noise_rotation_deg);
  config.read("seed", options.seed);
  config.read("latency_ms", options.latency_ms);
  VENEER_TRY(options.check());
  std::vector<Path> paths;
  for (TomlReader& table : config.tables("path")) {
    VENEER_ASSIGN(Path path, Path::read(table));
    if (std::ranges::find(paths, path.body(), &Path::body) != paths.end()) {
      return fail(
          Errc::kInvalidOption,
          "opening the simulated tracker: body {} has two paths; give every path a body of its own",
          path.body());
    }
    paths.push_back(std::move(path));
  }
  if (paths.empty()) {
    return fail(Errc::kInvalidOption,
                "opening the simulated tracker: there is no path; add a [[tracker.path]] table");
  }
  return std::unique_ptr<SimulatedTracker>(new SimulatedTracker(options, std::move(paths), clock));
}

SimulatedTracker::SimulatedTracker(const SimulatedTrackerOptions& options,
                                   std::vector<Path> paths,
                                   Clock& clock)
    : options_(options), paths_(std::move(paths)), clock_(clock), start_(clock.now()) {
  for (std::size_t i = 0; i < paths_.size(); ++i) noise_.emplace_back(options_.seed, i);
}

std::string SimulatedTracker::description() const {
  return fmt::format("simulated tracker, {} {} at {} Hz",
                     paths_.size(),
                     paths_.size() == 1 ? "body" : "bodies",
                     options_.rate_hz);
}

Result<PoseSample> SimulatedTracker::wait_pose(Duration timeout) {
  // From the count, not from the sample before, so that the rounding to nanoseconds does not add
  // up.
  const Time measured =
      start_ + Duration{std::llround(1e9 * static_cast<double>(tick_) / options_.rate_hz)};
  VENEER_TRY(
      wait_for_arrival(clock_, measured + from_seconds(options_.latency_ms * 1e-3), timeout));

  const Path& path = paths_[next_path_];
  PoseSample sample;
  sample.body = path.body();
  sample.time = measured;
  sample.world_from_body = add_noise(path.at(to_seconds(measured - start_)), noise_[next_path_]);
  sample.sequence = tick_;
  if (++next_path_ == paths_.size()) {
    next_path_ = 0;
    ++tick_;
  }
  return sample;
}

std::optional<RigidTransform> SimulatedTracker::true_pose(BodyId body, Time when) const {
  const auto path = std::ranges::find(paths_, body, &Path::body);
  if (path == paths_.end()) return std::nullopt;
  return path->at(to_seconds(when - start_));
}

RigidTransform SimulatedTracker::add_noise(const RigidTransform& truth, Pcg32& random) const {
  const Eigen::Vector3d shift = normal_vector(random, options_.noise_position_mm * 1e-3);
  const Eigen::Vector3d turn =
      normal_vector(random, to_radians(Degrees{options_.noise_rotation_deg}).value);
  RigidTransform measured = truth;
  measured.translation += shift;
  const double angle_rad = turn.norm();
  if (angle_rad > 0)
    measured.rotation *= Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, turn / angle_rad));
  return measured;
}

}  // namespace veneer::tracking
