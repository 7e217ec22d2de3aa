// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "base/result.h"
#include "base/toml_reader.h"
#include "render/renderer.h"
#include "tracking/pose_track.h"
#include "tracking/presence.h"
#include "tracking/validator.h"

namespace veneer::daemon {

enum class ClockKind {
  kMonotonic,  ///< real time
  kVirtual,    ///< as fast as frames can be made, each one frame period after the last; repeatable
};

/// veneer.toml. Relative paths refer to the folder of the file. The tables [tracker] and [output]
/// belong to their drivers.
struct Config {
  std::filesystem::path scene;
  std::filesystem::path material;
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
  render::RendererOptions render;
  tracking::PredictionOptions prediction;
  tracking::PresenceOptions presence;
  tracking::ValidationOptions validation;

  /// Reads all but [tracker] and [output]; the caller calls finish() when the drivers have read
  /// theirs.
  [[nodiscard]] static Result<Config> read(TomlReader& toml);
};

}  // namespace veneer::daemon
