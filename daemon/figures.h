// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "base/clock.h"
#include "service/status.h"

namespace veneer::daemon {

/// What one frame took.
struct FrameFigures {
  Time done;        ///< when it was handed over, on the daemon's clock
  bool out = true;  ///< it went out: the display took it, or is dark as it was told
  double frame_ms = 0;
  double gpu_ms = std::numeric_limits<double>::quiet_NaN();  ///< NaN where nobody knows
  bool late = false;             ///< it took longer than a period, or missed its refresh
  bool dark = false;             ///< nothing was drawn, or shown: it tells nothing of times
  std::uint64_t missed = 0;      ///< refreshes that passed for want of this frame
  std::uint64_t dropped = 0;     ///< refreshes for which no frame was ready, since the start
  std::uint64_t late_total = 0;  ///< late frames, likewise
  service::LatencyBudget latency_ms;
};

/// The figures of the last frames: one thread posts, any others ask. They lie in a ring whose slots
/// carry sequence numbers, so that posting neither waits, locks nor allocates, and who asks does
/// the work of medians himself.
class FigureBoard {
 public:
  FigureBoard();
  void post(const FrameFigures& figures);

  struct Figures {
    std::uint64_t frames = 0;  ///< that went out
    std::uint64_t dropped = 0;
    std::uint64_t late = 0;
    double frame_rate_hz = 0;
    double frame_ms_median = 0;
    double frame_ms_p95 = 0;
    double gpu_ms_median = 0;
    service::LatencyBudget latency_ms;
  };
  /// Of the frames of the second before `now`.
  [[nodiscard]] Figures last_second(Time now) const;
  /// The part of the refreshes within `span` before `now` that had a late frame or none; 0 to 1. A
  /// frame that was dark, or that the output refused, came in time: what kept it away has a name of
  /// its own. Nothing where no frame was done in that time: one may be under way; nor before there
  /// were frames for so long.
  [[nodiscard]] std::optional<double> late_part(Time now, Duration span) const;
  /// The rung of the quality on which the last frame was drawn, or which is faded to.
  void set_rung(std::size_t rung) { rung_.store(rung, std::memory_order_relaxed); }
  [[nodiscard]] std::size_t rung() const { return rung_.load(std::memory_order_relaxed); }
  /// The machine slept for so long.
  void note_sleep(Duration time) { slept_.fetch_add(time.count(), std::memory_order_relaxed); }
  [[nodiscard]] Duration slept() const { return Duration{slept_}; }  ///< in all
  /// That went out since the start.
  [[nodiscard]] std::uint64_t frames() const { return out_; }
  /// All since the start, those that the display refused included.
  [[nodiscard]] std::uint64_t turns() const { return posted_; }

  static constexpr std::size_t kSlots = 4096;  ///< frames: three seconds at 1000 a second

 private:
  static constexpr std::size_t kWords = 14;
  struct Slot {
    std::atomic<std::uint64_t> stamp{
        0};  // 2 n + 1 while frame n is written, 2 n + 2 when it is there
    std::array<std::atomic<std::uint64_t>, kWords> words{};
  };
  /// Newest first, those that were done after `since`.
  [[nodiscard]] std::vector<FrameFigures> after(Time since) const;

  std::unique_ptr<std::array<Slot, kSlots>> slots_;
  std::atomic<std::uint64_t> posted_{0};
  std::atomic<std::uint64_t> out_{0};
  std::atomic<std::uint64_t> dropped_{0};
  std::atomic<std::uint64_t> late_{0};
  std::atomic<std::size_t> rung_{0};
  std::atomic<Duration::rep> slept_{0};
};

/// The medians, each of its own column, so that their total is near that of a median frame.
[[nodiscard]] service::LatencyBudget medians(const std::vector<service::LatencyBudget>& budgets);

}  // namespace veneer::daemon
