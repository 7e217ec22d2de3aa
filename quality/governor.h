// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/result.h"

namespace veneer::quality {

enum class GovernorMode {
  kFixed,     ///< the rung that is named, whatever it costs
  kDeadline,  ///< the best rung that keeps the deadline
  kBest,      ///< the first rung, whatever it costs: frames may come late
};
/// "fixed", "deadline" or "best". Errors: kInvalidOption.
[[nodiscard]] Result<GovernorMode> parse_governor_mode(std::string_view text);
[[nodiscard]] std::string_view name_of(GovernorMode mode);

struct GovernorOptions {
  GovernorMode mode = GovernorMode::kBest;
  std::size_t fixed_rung = 0;
  double deadline_ms = 15;  ///< of a frame's work; > 0 (checked)
  /// Up only where the better rung is expected to take less than this part of the deadline.
  double room_up = 0.85;
  Duration least_between_steps = std::chrono::seconds(1);
  int fade_frames = 12;  ///< over which one rung turns into the next; 0: at once
};

/// Which rung each frame is drawn on, 0 the best. Pure: told what frames took, asked what to draw
/// next; it has no clock and no GL of its own. Neither allocates nor locks once it is made.
///
/// What a rung would cost under the load of the moment is what the present one costs, times the
/// ratio of the two; the ratios are those that were measured at first, and are put right with every
/// step, from what frames took before and after it. A rung is left downwards once half of the last
/// frames missed the deadline, or a tenth of the last fifty came near it, or a fiftieth of the last
/// four hundred missed it; upwards only when the better one has been expected to keep well inside
/// for a while. That while doubles whenever a rung had to be left again soon, so that a load that
/// comes and goes does not make the picture do so.
class Governor {
 public:
  /// @param ratios  of the rungs' costs, best first: Rung::ratio. At least one, all > 0 (checked).
  Governor(const GovernorOptions& options, std::vector<double> ratios);

  struct Choice {
    std::size_t level = 0;  ///< as FrameInput has them
    std::size_t next_level = 0;
    double fade = 0;
    bool operator==(const Choice&) const = default;
  };
  /// What the frame that begins at `now` is to be drawn on. Time may jump.
  [[nodiscard]] Choice next(Time now);
  /// What that frame took. @param ms  of the work that the rung decides; what is not finite or
  /// negative is as if nobody had looked. Frames of a fade teach nothing.
  void took(const Choice& choice, double ms);
  /// The rung that is drawn, or faded to.
  [[nodiscard]] std::size_t rung() const { return rung_; }
  [[nodiscard]] std::size_t rung_count() const { return ratio_.size(); }
  /// Of a frame's work, from now on; > 0 (checked).
  void set_deadline(double ms);
  /// Goes on where another one was, whose ladder this was too or had as many rungs.
  void begin_on(std::size_t rung);
  /// Steps so far.
  [[nodiscard]] std::size_t steps() const { return steps_; }
  /// Whether frames miss the deadline, and nothing cheaper is left.
  [[nodiscard]] bool is_overloaded() const;

 private:
  static constexpr std::size_t kWindow = 50;  // frames
  static constexpr std::size_t kHistory = 400;
  static constexpr std::size_t kRecent = 6;
  // The n-th last frame on this rung, from 0.
  [[nodiscard]] double last(std::size_t n) const { return history_[(seen_ - 1 - n) % kHistory]; }
  /// Of the last frames on this rung; nothing before there are enough.
  [[nodiscard]] std::optional<double> quantile(double part) const;
  [[nodiscard]] bool misses() const;        // half of the last few frames
  [[nodiscard]] bool comes_near() const;    // a tenth of the window
  [[nodiscard]] bool misses_often() const;  // a fiftieth of the history
  [[nodiscard]] double expected(std::size_t rung, double ms_here) const;
  void forget_room();
  void learn();
  void step(std::size_t rung, Time now);
  void consider(Time now);
  [[nodiscard]] std::size_t rung_below(double ms_here) const;

  GovernorOptions options_;
  std::vector<double> ratio_;  // as learned
  std::size_t rung_ = 0;
  // A step that is under way, or whose effect is not yet known.
  std::size_t from_ = 0;
  int fade_left_ = 0;
  std::optional<double> before_;  // what frames took on from_
  // Of frames on rung_, a ring.
  std::array<double, kHistory> history_{};
  std::size_t seen_ = 0;
  std::optional<Time> last_;
  std::optional<Time> stepped_;
  std::vector<std::optional<Time>> room_since_;  // for this rung
  std::vector<Duration> patience_;               // before a step up to it
  std::optional<std::size_t> tried_;             // the rung that the last step went up to
  std::size_t steps_ = 0;
};

}  // namespace veneer::quality
