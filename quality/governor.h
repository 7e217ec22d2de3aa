// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "base/clock.h"

namespace veneer::quality {

enum class GovernorMode {
  kFixed,     ///< the rung that is named, whatever it costs
  kDeadline,  ///< the best rung that keeps the deadline
  kBest,      ///< the first rung, whatever it costs: frames may come late
};

struct GovernorOptions {
  GovernorMode mode = GovernorMode::kDeadline;
  std::size_t fixed_rung = 0;
  double deadline_ms = 0;  ///< of a frame's work; > 0
  /// Down at once when frames threaten to miss, up only when the better rung is expected to take
  /// less than this part of the deadline. 0 to 1.
  double room_up = 0.85;
  Duration least_between_steps = std::chrono::seconds(1);
  int fade_frames = 12;  ///< over which one rung turns into the next
};

/// Which rung each frame is drawn on. Pure: told what frames took, asked what to draw next; it has
/// no clock and no GL of its own. Neither allocates nor locks after it was made.
class Governor {
 public:
  /// @param ratios  of the rungs' costs, best first: Rung::ratio. At least one.
  Governor(const GovernorOptions& options, std::vector<double> ratios);

  struct Choice {
    std::size_t level = 0;  ///< as FrameInput has them
    std::size_t next_level = 0;
    double fade = 0;
  };
  /// What the frame that begins at `now` is to be drawn on.
  [[nodiscard]] Choice next(Time now);
  /// What a frame took. @param ms  of the work that the rung decides; not finite: nothing is known.
  void took(const Choice& choice, double ms);
  /// The rung that is drawn, or faded to.
  [[nodiscard]] std::size_t rung() const;

 private:
  GovernorOptions options_;
  std::vector<double> ratios_;
};

}  // namespace veneer::quality
