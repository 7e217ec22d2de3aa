// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace veneer::cli {

/// A frame that a governor chose how to draw.
struct GovernedFrame {
  double second = 0;     ///< when it began
  std::size_t rung = 0;  ///< as Governor::rung(), with this frame's choice made
  bool fading = false;
  double ms = 0;  ///< what it took
};

/// A time under a load that stays.
struct LoadPhase {
  double from_s = 0;
  double to_s = 0;
};

/// How a governor did in one phase.
struct PhaseFigures {
  std::size_t frames = 0;
  std::size_t steady_frames = 0;  ///< no change of load and no step less than `settle_s` before
  /// Of these, the part within the deadline; nothing where there were none.
  std::optional<double> inside_steady;
  std::optional<double> inside;  ///< of all frames
  std::size_t steps = 0;
  double steps_per_minute = 0;
  /// Steps that go back to the rung which the step before them in this phase had left: one is a
  /// trial that failed, two in a row are an oscillation.
  std::size_t returns = 0;
  std::size_t longest_returns = 0;    ///< in a row
  std::vector<double> share_of_rung;  ///< of the frames
  std::size_t last_rung = 0;
};

/// @param frames  of a whole run, in the order of time.  @param rungs  how many there are.
[[nodiscard]] PhaseFigures figures_of(const std::vector<GovernedFrame>& frames,
                                      const LoadPhase& phase,
                                      double deadline_ms,
                                      std::size_t rungs,
                                      double settle_s);
/// The least time between two steps of a run; nothing with fewer.
[[nodiscard]] std::optional<double> least_between_steps(const std::vector<GovernedFrame>& frames);
/// Seconds from `phase`'s begin until a frame is all on a rung at least as good as `rung`; nothing
/// if none in the phase is.
[[nodiscard]] std::optional<double> seconds_to(std::size_t rung,
                                               const std::vector<GovernedFrame>& frames,
                                               const LoadPhase& phase);

}  // namespace veneer::cli
