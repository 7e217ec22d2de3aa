// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/clock.h"

namespace veneer::daemon {

/// When a display's refreshes begin, followed from the stamps of those that showed a frame: a
/// phase-locked loop of second order, which averages the stamps' jitter and follows a period that
/// drifts. Refreshes without a stamp do not matter to it.
class RefreshClock {
 public:
  /// @param nominal  as the display's mode says. > 0 (checked).
  explicit RefreshClock(Duration nominal);
  /// A refresh began at `stamp`. One that is far off the expected ones is not believed, unless the
  /// next ones agree with it: then the display has begun anew.
  void add(Time stamp);
  /// Forgets the phase: the machine slept, or the display was opened again.
  void start_over();
  [[nodiscard]] bool known() const { return anchor_.has_value(); }
  [[nodiscard]] Duration period() const;
  /// The first refresh after `when` (not at it). `when` plus a period while none is known.
  [[nodiscard]] Time next_after(Time when) const;
  /// The refresh that is nearest to `when`; `when` itself while none is known.
  [[nodiscard]] Time nearest(Time when) const;

 private:
  double nominal_ns_;
  double period_ns_;
  std::optional<Time> anchor_;  // a refresh
  double fraction_ns_ = 0;      // and what its whole nanoseconds leave out
  int strange_ = 0;             // stamps in a row that were not believed
};

/// Decides when a frame reads its pose, so that it is ready for a refresh and no sooner than
/// needed: the time that drawing takes (nearly the longest of the last frames) and a margin before
/// the refresh. The margin grows at once when a frame misses its refresh and shrinks slowly while
/// none does, and never makes a frame of more than a period out of a shorter one. After frames that
/// took longer than a period the full rate is back as soon as a few have not. Allocates nothing.
class Pacer {
 public:
  /// @param period  from refresh to refresh. > 0 (checked).
  /// @param late    off: the pose is read as soon as the frame before is handed over.
  Pacer(Duration period, bool late);

  struct Plan {
    Time wake;                  ///< when to read the pose
    Time refresh;               ///< which is to show the frame
    std::uint64_t skipped = 0;  ///< refreshes since the frame before that show nothing new
  };
  /// For the frame of this number; numbers grow. Never plans two frames for one refresh.
  [[nodiscard]] Plan plan(std::uint64_t number, Time now);
  /// How long the last frame took, from reading its pose until it was handed over.
  void took(Duration time);
  /// The display says that it showed a frame. The same one may be told again.
  /// Returns whether it is news of a frame that came later than was planned.
  bool shown(std::uint64_t number, Time when);
  void start_over();

  /// What plan() leaves before a refresh.
  [[nodiscard]] Duration lead() const;
  [[nodiscard]] Duration margin() const { return margin_; }
  [[nodiscard]] const RefreshClock& refreshes() const { return refreshes_; }

 private:
  static constexpr std::size_t kRemembered = 64;  // frames; a second at 60 a second
  struct Planned {
    std::uint64_t number = 0;
    Time refresh;
  };

  RefreshClock refreshes_;
  bool late_;
  bool guessed_ = false;  // the phase, until the display tells
  Duration margin_;
  std::array<Duration, kRemembered> times_{};
  std::size_t time_count_ = 0;
  std::array<Planned, kRemembered> planned_{};
  std::optional<Time> last_refresh_;
  std::optional<std::uint64_t> last_shown_;
};

}  // namespace veneer::daemon
