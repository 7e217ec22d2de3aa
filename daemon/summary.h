// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"
#include "daemon/frame_loop.h"
#include "daemon/profile_watcher.h"

namespace veneer::daemon {

/// The figures of a run, for the log, the summary file and reports.
struct Summary {
  std::uint64_t frames = 0;
  double fps = 0;
  double frame_ms_p50 = 0;
  double frame_ms_p99 = 0;
  double pose_age_ms_p50 = 0;
  double pose_age_ms_p99 = 0;
  std::uint64_t dropped = 0;
  std::uint64_t late = 0;
  std::uint64_t held = 0;           ///< frames drawn for a pose that was only held
  std::uint64_t lost = 0;           ///< of these, frames for an observer who was lost
  std::uint64_t quality_steps = 0;  ///< from one rung to another
  std::vector<std::uint64_t>
      frames_on_rung;  ///< remembered ones, by rung; fades count for where they lead
  std::uint64_t rejected_poses = 0;
  bool tracker_lost = false;
  tracking::TrackerCounters tracker_counters;
  std::vector<TrackerEvent> tracker_events;
  std::uint64_t output_waits = 0;  ///< how often a frame had to wait for the output
  double out_of_gamut = 0;         ///< fraction of the covered pixels, over all frames
  double out_of_reach = 0;         ///< likewise, too dark for the projector's angle
  double gamut_loss_mean = 0;      ///< FrameStatistics::gamut_loss_mean over all frames
  std::string renderer;
  std::string tracker;
  std::string output;
  std::string clock;                   ///< "monotonic" or "virtual"
  std::vector<std::string> settings;   ///< that replaced values of the configuration
  int bits = 0;                        ///< of a drive code
  ProfileCounts profiles;              ///< that appeared during the run
  service::LatencyBudget latency_ms;   ///< medians over the remembered frames
  std::uint64_t recovered_faults = 0;  ///< that were overcome
  Time tracker_start;                  ///< time zero of a simulated tracker's paths
};

[[nodiscard]] Summary summarise(const RunRecord& run);
/// One line for people.
[[nodiscard]] std::string text_of(const Summary& summary);
/// Written whole or not at all.
[[nodiscard]] Status write_summary(const Summary& summary, const std::filesystem::path& path);
/// CSV: frame, display_time_ns, frame_ms, gpu_ms, pose_age_ms, eye x, y, z, pixels covered and out
/// of gamut, observer (a body), his presence, specular_weight, rung and fade, and the parts
/// of the latency in milliseconds (service::LatencyBudget).
[[nodiscard]] Status write_frame_log(const RunRecord& run, const std::filesystem::path& path);

}  // namespace veneer::daemon
