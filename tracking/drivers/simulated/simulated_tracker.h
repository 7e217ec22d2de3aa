// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/random.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/drivers/simulated/path.h"
#include "tracking/drivers/simulated/pose_noise.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// How a simulated tracker measures; keys of the [tracker] table.
struct SimulatedTrackerOptions {
  /// Samples a second of every body. 1 to 10000.
  double rate_hz = 240;
  PoseNoise noise{};
  /// Seeds the noise.
  std::uint64_t seed = 1;
  /// From the moment of measurement to the arrival of the sample. 0 to 1000.
  double latency_ms = 0;
  [[nodiscard]] Status check() const;
};

/// A tracker whose bodies move on scripted paths. Sample k of every body is measured at
/// start() + k / rate_hz, a grid of its own, and arrives latency_ms later; nothing is ever lost,
/// and whoever asks late gets what has queued up. On a VirtualClock every run is the same.
class SimulatedTracker final : public Tracker {
 public:
  /// Reads SimulatedTrackerOptions and the [[tracker.path]] tables (one or more, each body once);
  /// time zero of the paths is the clock's now().
  /// @param clock  borrowed; must outlive the tracker.
  /// Errors: kInvalidOption.
  [[nodiscard]] static Result<std::unique_ptr<SimulatedTracker>> open(TomlReader& config,
                                                                      Clock& clock);

  [[nodiscard]] std::string description() const override;
  [[nodiscard]] Result<PoseSample> wait_pose(Duration timeout) override;

  /// When the paths began.
  [[nodiscard]] Time start() const { return start_; }
  /// Ground truth: world_from_body at `when`, without noise; nothing for a body without a path.
  /// Thread-safe.
  [[nodiscard]] std::optional<RigidTransform> true_pose(BodyId body, Time when) const;

 private:
  SimulatedTracker(const SimulatedTrackerOptions& options, std::vector<Path> paths, Clock& clock);

  SimulatedTrackerOptions options_;
  std::vector<Path> paths_;
  std::vector<Pcg32> noise_;  // one a path
  Clock& clock_;
  Time start_;
  std::uint64_t tick_ = 0;     // the next sample's place on the grid
  std::size_t next_path_ = 0;  // and its path
};

}  // namespace veneer::tracking
