// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/clock.h"
#include "base/progress.h"
#include "base/result.h"
#include "daemon/config.h"
#include "daemon/observers.h"
#include "daemon/pose_feed.h"
#include "daemon/profile_watcher.h"
#include "projector/output.h"
#include "render/prepared_profile.h"
#include "render/renderer.h"
#include "render/scene.h"

namespace veneer::daemon {

/// What is remembered of one frame.
struct FrameRecord {
  std::uint64_t number = 0;
  Time display_time;
  double frame_ms = 0;            ///< real time from the pose query to the frame handed over
  double pose_age_ms = 0;         ///< from the newest sample to the moment of display
  tracking::BodyId observer = 0;  ///< whose picture it is
  tracking::Presence presence = tracking::Presence::kNone;  ///< his
  double specular_weight = 1;                               ///< FrameInput::specular_weight
  Eigen::Vector3d eye_in_world = Eigen::Vector3d::Zero();   ///< as predicted and shown
  render::FrameStatistics statistics;
};

/// Frames that a run remembers: a quarter of an hour and more at 60 a second, in bounded memory.
inline constexpr std::size_t kRememberedFrames = 1U << 16U;

struct RunRecord {
  std::vector<FrameRecord> frames;  ///< the last kRememberedFrames, oldest first
  std::uint64_t count = 0;          ///< all
  std::uint64_t dropped = 0;        ///< display periods for which no frame was ready
  std::uint64_t late = 0;           ///< frames that took longer than a period to make
  double seconds = 0;               ///< real time from the first frame to the last handed over
  std::uint64_t held = 0;  ///< frames drawn for a pose that was held, not measured or predicted
  std::uint64_t lost = 0;  ///< of these, frames for an observer who was lost
};

/// Tracker -> predict -> draw -> compensate -> present, once a frame period. Borrows all it is
/// given.
class FrameLoop {
 public:
  /// @param profiles  asked for another profile after every frame; null where it stays.
  FrameLoop(const Config& config,
            const render::Scene& scene,
            const render::RasterFormat& raster,
            Clock& clock,
            PoseFeed& poses,
            render::Renderer& renderer,
            projector::Output& output,
            ProfileWatcher* profiles = nullptr);
  /// Runs until Config::frames are made or `stop` becomes true.
  /// Errors: kTimeout (no first pose), kDisconnected (tracker gone before it), what the output
  /// says.
  [[nodiscard]] Result<RunRecord> run(const std::atomic<bool>& stop, Progress& progress);

 private:
  [[nodiscard]] Status wait_for_first_pose(const std::atomic<bool>& stop);
  [[nodiscard]] Result<FrameRecord> make_frame(std::uint64_t number, Time start);

  const Config& config_;
  const render::Scene& scene_;
  render::RasterFormat raster_;
  Clock& clock_;
  PoseFeed& poses_;
  Observers observers_;
  tracking::PresenceFilter object_;
  render::Renderer& renderer_;
  projector::Output& output_;
  ProfileWatcher* profiles_;
  Image<Rgb16> codes_;
  Image<Rgb32f> target_;
  bool tracker_lost_ = false;  // and said so
};

}  // namespace veneer::daemon
