// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated/simulated_tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

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

}  // namespace

Status SimulatedTrackerOptions::check() const {
  VENEER_TRY(check_range("rate_hz", rate_hz, 1, 10000));
  return check_range("latency_ms", latency_ms, 0, 1000);
}

Result<std::unique_ptr<SimulatedTracker>> SimulatedTracker::open(TomlReader& config, Clock& clock) {
  SimulatedTrackerOptions options;
  config.read("rate_hz", options.rate_hz);
  options.noise = PoseNoise::read(config);
  config.read("seed", options.seed);
  config.read("latency_ms", options.latency_ms);
  VENEER_TRY(options.check());
  VENEER_ASSIGN(std::vector<Path> paths, Path::read_all(config));
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
  sample.world_from_body =
      options_.noise.added_to(path.at(to_seconds(measured - start_)), noise_[next_path_]);
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

}  // namespace veneer::tracking
