// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "cli/track/pose_statistics.h"
#include "tracking/tracker.h"

namespace veneer::cli {

using BodyStatistics = std::map<tracking::BodyId, PoseStatistics>;

/// Listens to the tracker of a configuration in real time, and keeps count.
class TrackSession {
 public:
  /// @param config    veneer.toml, of which only the [tracker] table is read.
  /// @param settings  "tracker.rate_hz=30", as veneerd takes them.
  /// Errors: as open_tracker().
  [[nodiscard]] static Result<TrackSession> open(const std::filesystem::path& config,
                                                 const std::vector<std::string>& settings);

  /// Hands samples on until `seconds` have passed (0: no limit), the tracker has ended (a replay
  /// does) or the user stops it (Ctrl-C, SIGTERM).
  /// @param take  gets every sample; an error ends the session.
  /// @param tick  called every `tick_period`, also when nothing comes.
  [[nodiscard]] Status run(double seconds,
                           const std::function<Status(const tracking::PoseSample&)>& take,
                           Duration tick_period,
                           const std::function<void()>& tick);

  [[nodiscard]] const tracking::Tracker& tracker() const { return *tracker_; }
  [[nodiscard]] const BodyStatistics& bodies() const { return bodies_; }
  /// What has come since this was called last.
  [[nodiscard]] BodyStatistics take_recent();
  [[nodiscard]] double seconds() const;  ///< since it was opened
  /// Why no sample came, and what to do about it; for the end of a session without any.
  [[nodiscard]] tl::unexpected<Error> nothing_came() const;

 private:
  TrackSession() = default;
  std::unique_ptr<SteadyClock> clock_ = std::make_unique<SteadyClock>();  // its address is kept
  std::unique_ptr<tracking::Tracker> tracker_;
  Time opened_;
  BodyStatistics bodies_;
  BodyStatistics recent_;
};

}  // namespace veneer::cli
