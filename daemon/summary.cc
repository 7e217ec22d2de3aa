// SPDX-License-Identifier: Apache-2.0
#include "daemon/summary.h"

#include <nlohmann/json.hpp>

#include "base/files.h"
#include "base/statistics.h"

namespace veneer::daemon {
namespace {

nlohmann::ordered_json json_of(const tracking::TrackerCounters& counters) {
  return {
      {"samples", counters.samples},
      {"lost", counters.lost},
      {"duplicates", counters.duplicates},
      {"late", counters.late},
      {"suspect", counters.suspect},
      {"skipped_bytes", counters.skipped_bytes},
      {"bad_frames", counters.bad_frames},
      {"clock_outliers", counters.clock_outliers},
      {"clock_restarts", counters.clock_restarts},
      {"io_errors", counters.io_errors},
      {"restarts", counters.restarts},
      {"opened", counters.opened},
      {"open_errors", counters.open_errors},
  };
}

nlohmann::ordered_json json_of(const service::LatencyBudget& budget) {
  return {
      {"tracker", budget.tracker},
      {"hand_off", budget.hand_off},
      {"wait", budget.wait},
      {"draw", budget.draw},
      {"gpu_draw", budget.gpu_draw},
      {"compensate", budget.compensate},
      {"present", budget.present},
      {"display", budget.display},
      {"total", budget.total()},
  };
}

nlohmann::ordered_json json_of(const std::vector<TrackerEvent>& events) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const TrackerEvent& event : events) {
    list.push_back({{"t_ns", event.time.time_since_epoch().count()},
                    {"state", name_of(event.state)},
                    {"detail", event.detail}});
  }
  return list;
}

}  // namespace

Summary summarise(const RunRecord& run) {
  Summary summary;
  std::vector<double> frame_ms;
  std::vector<double> pose_age_ms;
  std::vector<service::LatencyBudget> budgets;
  double covered = 0;
  for (const FrameRecord& frame : run.frames) {
    frame_ms.push_back(frame.frame_ms);
    budgets.push_back(frame.latency_ms);
    if (frame.rung >= summary.frames_on_rung.size()) summary.frames_on_rung.resize(frame.rung + 1);
    ++summary.frames_on_rung[frame.rung];
    pose_age_ms.push_back(frame.pose_age_ms);
    const auto pixels = static_cast<double>(frame.statistics.covered_pixels);
    covered += pixels;
    summary.out_of_gamut += static_cast<double>(frame.statistics.out_of_gamut_pixels);
    summary.out_of_reach += static_cast<double>(frame.statistics.out_of_reach_pixels);
    summary.gamut_loss_mean += pixels * frame.statistics.gamut_loss_mean;
  }
  if (covered > 0) {
    summary.out_of_gamut /= covered;
    summary.out_of_reach /= covered;
    summary.gamut_loss_mean /= covered;
  }
  summary.frames = run.count;
  summary.fps = run.seconds > 0 ? static_cast<double>(run.count) / run.seconds : 0;
  summary.frame_ms_p50 = quantile(frame_ms, 0.5);
  summary.frame_ms_p99 = quantile(frame_ms, 0.99);
  summary.pose_age_ms_p50 = quantile(pose_age_ms, 0.5);
  summary.pose_age_ms_p99 = quantile(pose_age_ms, 0.99);
  summary.latency_ms = medians(budgets);
  summary.dropped = run.dropped;
  summary.late = run.late;
  summary.held = run.held;
  summary.lost = run.lost;
  summary.quality_steps = run.quality_steps;
  return summary;
}

std::string text_of(const Summary& summary) {
  return fmt::format(
      "{} frames at {:.1f} a second; a frame takes {:.1f} ms (p99 {:.1f}), its pose is {:.1f} ms "
      "old "
      "(p99 {:.1f}) when it is seen; {} dropped, {} late; {:.1f} % of the pixels out of gamut",
      summary.frames,
      summary.fps,
      summary.frame_ms_p50,
      summary.frame_ms_p99,
      summary.pose_age_ms_p50,
      summary.pose_age_ms_p99,
      summary.dropped,
      summary.late,
      100 * summary.out_of_gamut);
}

Status write_summary(const Summary& summary, const std::filesystem::path& path) {
  const nlohmann::ordered_json json{
      {"frames", summary.frames},
      {"fps", summary.fps},
      {"frame_ms_p50", summary.frame_ms_p50},
      {"frame_ms_p99", summary.frame_ms_p99},
      {"pose_age_ms_p50", summary.pose_age_ms_p50},
      {"pose_age_ms_p99", summary.pose_age_ms_p99},
      {"dropped_frames", summary.dropped},
      {"late_frames", summary.late},
      {"quality_steps", summary.quality_steps},
      {"frames_on_rung", summary.frames_on_rung},
      {"held_frames", summary.held},
      {"lost_frames", summary.lost},
      {"rejected_poses", summary.rejected_poses},
      {"tracker_lost", summary.tracker_lost},
      {"tracker_counters", json_of(summary.tracker_counters)},
      {"tracker_events", json_of(summary.tracker_events)},
      {"output_waits", summary.output_waits},
      {"out_of_gamut", summary.out_of_gamut},
      {"out_of_reach", summary.out_of_reach},
      {"gamut_loss_mean", summary.gamut_loss_mean},
      {"renderer", summary.renderer},
      {"tracker", summary.tracker},
      {"output", summary.output},
      {"clock", summary.clock},
      {"settings", summary.settings},
      {"bits", summary.bits},
      {"profile_reloads", summary.profiles.reloads},
      {"profile_refusals", summary.profiles.refusals},
      {"profile_swap_ms_max", summary.profiles.longest_swap_ms},
      {"latency_ms", json_of(summary.latency_ms)},
      {"recovered_faults", summary.recovered_faults},
      {"tracker_start_ns", summary.tracker_start.time_since_epoch().count()},
  };
  return write_text(path, json.dump(2) + "\n");
}

Status write_frame_log(const RunRecord& run, const std::filesystem::path& path) {
  std::string text =
      "frame,display_time_ns,frame_ms,gpu_ms,pose_age_ms,eye_x,eye_y,eye_z,covered,out_of_gamut,"
      "observer,"
      "presence,specular_weight,rung,fade,tracker_ms,hand_off_ms,wait_ms,draw_ms,gpu_draw_ms,"
      "compensate_ms,"
      "present_ms,display_ms,presented_ns\n";
  for (const FrameRecord& frame : run.frames) {
    const std::optional<double>& gpu_ms = frame.statistics.gpu_ms;
    text += fmt::format(
        "{},{},{:.4f},{},{:.4f},{:.6f},{:.6f},{:.6f},{},{},{},{},{:.4f},{},{:.4f},"
        "{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{}\n",
        frame.number,
        frame.display_time.time_since_epoch().count(),
        frame.frame_ms,
        gpu_ms ? fmt::format("{:.4f}", *gpu_ms) : "",
        frame.pose_age_ms,
        frame.eye_in_world.x(),
        frame.eye_in_world.y(),
        frame.eye_in_world.z(),
        frame.statistics.covered_pixels,
        frame.statistics.out_of_gamut_pixels,
        frame.observer,
        name_of(frame.presence),
        frame.specular_weight,
        frame.rung,
        frame.fade,
        frame.latency_ms.tracker,
        frame.latency_ms.hand_off,
        frame.latency_ms.wait,
        frame.latency_ms.draw,
        frame.latency_ms.gpu_draw,
        frame.latency_ms.compensate,
        frame.latency_ms.present,
        frame.latency_ms.display,
        frame.presented ? fmt::format("{}", frame.presented->time_since_epoch().count()) : "");
  }
  return write_text(path, text);
}

}  // namespace veneer::daemon
