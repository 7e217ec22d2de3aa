// SPDX-License-Identifier: Apache-2.0
#include "cli/governor/drive.h"

#include <algorithm>

namespace veneer::cli {
namespace {

std::optional<double> part(std::size_t some, std::size_t all) {
  if (all == 0) return std::nullopt;
  return static_cast<double>(some) / static_cast<double>(all);
}

bool is_in(const GovernedFrame& frame, const LoadPhase& phase) {
  return frame.second >= phase.from_s && frame.second < phase.to_s;
}

}  // namespace

PhaseFigures figures_of(const std::vector<GovernedFrame>& frames,
                        const LoadPhase& phase,
                        double deadline_ms,
                        std::size_t rungs,
                        double settle_s) {
  PhaseFigures figures;
  figures.share_of_rung.assign(rungs, 0.0);
  std::size_t inside = 0;
  std::size_t inside_steady = 0;
  std::optional<std::size_t> left;  // by the last step of this phase
  std::size_t in_a_row = 0;
  double changed_s = phase.from_s;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const GovernedFrame& frame = frames[i];
    const bool stepped = i > 0 && frames[i - 1].rung != frame.rung;
    if (!is_in(frame, phase)) continue;
    if (stepped) {
      const bool returns = left == frame.rung;
      in_a_row = returns ? in_a_row + 1 : 0;
      figures.returns += returns ? 1 : 0;
      figures.longest_returns = std::max(figures.longest_returns, in_a_row);
      left = frames[i - 1].rung;
      changed_s = frame.second;
      ++figures.steps;
    }
    const bool in_time = frame.ms <= deadline_ms;
    ++figures.frames;
    inside += in_time ? 1 : 0;
    if (frame.second - changed_s >= settle_s) {
      ++figures.steady_frames;
      inside_steady += in_time ? 1 : 0;
    }
    figures.share_of_rung[frame.rung] += 1;
    figures.last_rung = frame.rung;
  }
  for (double& share : figures.share_of_rung)
    share /= static_cast<double>(std::max<std::size_t>(figures.frames, 1));
  figures.inside = part(inside, figures.frames);
  figures.inside_steady = part(inside_steady, figures.steady_frames);
  const double length_s = phase.to_s - phase.from_s;
  if (length_s > 0) figures.steps_per_minute = 60.0 * static_cast<double>(figures.steps) / length_s;
  return figures;
}

std::optional<double> least_between_steps(const std::vector<GovernedFrame>& frames) {
  std::optional<double> least;
  std::optional<double> last;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].rung == frames[i - 1].rung) continue;
    if (last) least = std::min(least.value_or(frames[i].second), frames[i].second - *last);
    last = frames[i].second;
  }
  return least;
}

std::optional<double> seconds_to(std::size_t rung,
                                 const std::vector<GovernedFrame>& frames,
                                 const LoadPhase& phase) {
  for (const GovernedFrame& frame : frames) {
    if (is_in(frame, phase) && !frame.fading && frame.rung <= rung)
      return frame.second - phase.from_s;
  }
  return std::nullopt;
}

}  // namespace veneer::cli
