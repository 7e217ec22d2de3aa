// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/clock.h"
#include "base/progress.h"
#include "base/result.h"
#include "daemon/config.h"
#include "daemon/faults.h"
#include "daemon/figures.h"
#include "daemon/output_keeper.h"
#include "daemon/pacer.h"
#include "daemon/pose_feed.h"
#include "daemon/show.h"
#include "daemon/show_loader.h"

namespace veneer::daemon {

/// What is remembered of one frame.
struct FrameRecord {
  std::uint64_t number = 0;
  Time display_time;              ///< for which its poses were predicted
  Time handed_over;               ///< to the output
  std::optional<Time> presented;  ///< when its first line went out, where the display tells
  double frame_ms = 0;            ///< real time from the pose query to the frame handed over
  double pose_age_ms = 0;         ///< from the newest sample to the light, as is known
  tracking::BodyId observer = 0;  ///< whose picture it is
  tracking::Presence presence = tracking::Presence::kNone;  ///< his
  double specular_weight = 1;                               ///< FrameInput::specular_weight
  std::size_t rung = 0;  ///< of the quality, the one that is drawn or faded to
  double fade = 0;       ///< how far; 0: it is there
  Eigen::Vector3d eye_in_world = Eigen::Vector3d::Zero();  ///< as predicted and shown
  render::FrameStatistics statistics;
  service::LatencyBudget latency_ms;
};

/// Frames that a run remembers: a quarter of an hour and more at 60 a second, in bounded memory.
inline constexpr std::size_t kRememberedFrames = 1U << 16U;

struct RunRecord {
  std::vector<FrameRecord> frames;  ///< the last kRememberedFrames that were seen, oldest first
  std::uint64_t count = 0;          ///< all, those that were dark or that no output took included
  std::uint64_t dropped = 0;        ///< display periods for which no frame was ready
  std::uint64_t late = 0;           ///< frames that took longer than a period to make
  double seconds = 0;               ///< real time from the first frame to the last handed over
  std::uint64_t held = 0;  ///< frames drawn for a pose that was held, not measured or predicted
  std::uint64_t lost = 0;  ///< of these, frames for an observer who was lost
  std::uint64_t quality_steps = 0;  ///< from one rung to another
};

/// A picture that somebody waits for; made by him, filled by the frame loop.
struct Snapshot {
  Image<Rgb16> codes;
  std::atomic<bool> done{false};
};

/// What others wish of the frame loop, between two frames.
struct Wishes {
  std::atomic<bool> dark{false};
  std::atomic<bool> is_dark{false};  ///< and what became of it
  /// Owned by who put it there; who exchanges it for null may use it.
  std::atomic<Snapshot*> snapshot{nullptr};
};

/// Tracker -> predict -> draw -> compensate -> present, once a refresh of the display or, where it
/// has none of its own, once a frame period. Goes on whatever happens: without a tracker for the
/// last pose, without an output for nobody, without a GPU in the dark.
class FrameLoop {
 public:
  /// Borrows all of it.
  struct Parts {
    const Config& config;
    Clock& clock;
    PoseFeed& poses;
    OutputKeeper& output;
    ShowLoader& loader;
    Faults& faults;
    FigureBoard& board;
    Wishes& wishes;
    std::function<void(std::uint64_t, Time)> before_frame;  ///< Devices::before_frame
    std::function<Duration()> time_asleep;                  ///< Devices::time_asleep, or nothing
  };
  FrameLoop(Parts parts, std::unique_ptr<Show> show);

  /// Runs until Config::frames are made, `stop` becomes true or somebody closes the output.
  /// Errors: kTimeout (no first pose), kDisconnected (tracker gone before it); what the output says
  /// at the end of a run of so many frames.
  [[nodiscard]] Result<RunRecord> run(const std::atomic<bool>& stop, Progress& progress);
  /// After the run: what was drawn with.
  [[nodiscard]] std::unique_ptr<Show> take_show() { return std::move(show_); }

 private:
  /// When a frame is made and when it is seen.
  struct Slot {
    Time wake;
    Time display;
    std::uint64_t missed = 0;  ///< refreshes since the frame before
  };
  enum class Made { kShown, kDark, kDropped, kClosed };

  [[nodiscard]] Status wait_for_first_pose(const std::atomic<bool>& stop);
  void follow_output();
  [[nodiscard]] Slot next_slot(std::uint64_t number);
  void start_over();
  void notice_sleep();
  enum class PoseTrouble { kNone, kTracker, kAll, kObserver, kObject };
  [[nodiscard]] PoseTrouble pose_trouble(Time now) const;
  void notice_tracker();
  void between_frames();
  [[nodiscard]] bool keep_output();
  [[nodiscard]] Made make_frame(const Slot& slot, FrameRecord& record);
  [[nodiscard]] Made make_dark();
  [[nodiscard]] Made lose_renderer();
  [[nodiscard]] render::FrameInput look(const Slot& slot, FrameRecord& record);
  void give_snapshot(bool dark);
  [[nodiscard]] static Made made_of(OutputKeeper::Outcome outcome);
  void account(const Slot& slot, Made made, FrameRecord& record);
  bool note_presented();
  [[nodiscard]] Duration display_latency() const;
  void drop_renderer();
  [[nodiscard]] double deadline_ms() const;
  [[nodiscard]] bool is_real_time() const { return parts_.config.clock == ClockKind::kMonotonic; }

  Parts parts_;
  std::unique_ptr<Show> show_;
  RunRecord run_;
  std::uint64_t seen_ = 0;  // frames that are in run_.frames, or were
  // Where the output has refreshes of its own.
  std::optional<Pacer> pacer_;
  Duration period_;
  Time start_;                        // of the next frame, where it has none
  std::optional<double> display_ms_;  // from handing over to the light, of the last that was seen
  bool first_made_ = false;
  bool dark_ = false;  // and the output knows
  bool dark_failed_ = false;
  Time dark_told_;
  bool renderer_asked_for_ = false;
  PoseTrouble pose_trouble_ = PoseTrouble::kNone;
  Duration slept_before_{};  // of CLOCK_BOOTTIME over CLOCK_MONOTONIC
};

}  // namespace veneer::daemon
