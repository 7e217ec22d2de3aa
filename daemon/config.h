// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "base/result.h"
#include "base/toml_reader.h"
#include "projector/control_watch.h"
#include "quality/governor.h"
#include "render/renderer.h"
#include "service/front.h"
#include "tracking/pose_track.h"
#include "tracking/presence.h"
#include "tracking/validator.h"

namespace veneer::daemon {

enum class ClockKind {
  kMonotonic,  ///< real time
  kVirtual,    ///< as fast as frames can be made, each one frame period after the last; repeatable
};

/// When a frame reads the pose, where the output has refreshes of its own.
enum class Latch {
  kLate,   ///< as late as the measured draw time allows
  kEarly,  ///< as soon as the frame before is out
};

/// What gives way where frames take too long: the table [quality].
struct QualityConfig {
  quality::GovernorMode mode = quality::GovernorMode::kBest;
  /// What `veneer trade` measured; empty: what can be taken off the one material without a fit.
  std::filesystem::path ladder;
  /// Of a frame's work, from the pose to the finished picture; 0: most of a frame's period.
  double deadline_ms = 0;
  int rung = 0;  ///< in the mode "fixed"
};

/// veneer.toml. Relative paths refer to the folder of the file. The tables [tracker], [output]
/// and [control] belong to their drivers.
struct Config {
  std::filesystem::path scene;
  std::filesystem::path material;  ///< may be empty where there is a ladder
  std::filesystem::path profile;
  ClockKind clock = ClockKind::kMonotonic;
  double frame_rate_hz = 60;  ///< 1 to 1000
  std::uint64_t frames = 0;   ///< 0: until stopped
  /// From the start of a frame to the light on the object; poses are predicted over it. 0 to 1000.
  double display_latency_ms = 16.7;
  /// How long to wait for the first pose before giving up. > 0.
  double first_pose_timeout_s = 5;
  std::filesystem::path summary;    ///< JSON written at the end; none where empty
  std::filesystem::path record;     ///< poses as they come, for the replay driver; none where empty
  std::filesystem::path frame_log;  ///< CSV, a line a frame; none where empty
  /// Where snapshots and what must outlive the process go; by default the environment's
  /// STATE_DIRECTORY, which systemd sets. None where empty.
  std::filesystem::path state_directory;
  /// Where what must outlive a crash goes, but not a stop: the environment's RUNTIME_DIRECTORY,
  /// which systemd sets; no key. None where empty.
  std::filesystem::path runtime_directory;
  Latch latch = Latch::kLate;
  projector::ControlWatchOptions control;  ///< of the table [control], without its driver's keys
  service::FrontOptions service;
  QualityConfig quality;
  render::RendererOptions render;
  render::DrawingOptions drawing;  ///< of the material, in [render] too
  tracking::PredictionOptions prediction;
  tracking::PresenceOptions presence;
  tracking::ValidationOptions validation;

  /// Reads all but what belongs to the drivers of the tracker, the output and the control, which is
  /// left to whoever opens them; the caller calls finish().
  [[nodiscard]] static Result<Config> read(TomlReader& toml);
};

}  // namespace veneer::daemon
