// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "tracking/drivers/simulated/path.h"

namespace veneer::cli {

/// A frame that veneerd wrote.
struct RecordedFrame {
  std::uint64_t number = 0;
  Duration display_time{};
  std::filesystem::path file;
};

/// A finished run of veneerd with the simulated tracker and the file output, read back from its
/// folder: veneer.toml as it was set, the summary run.json, the frames.
class RecordedRun {
 public:
  /// Errors: kNotFound, kBadFormat (a damaged summary or index, no frames), kInvalidOption (another
  /// tracker: nobody knows where the eye truly was).
  [[nodiscard]] static Result<RecordedRun> open(const std::filesystem::path& folder);

  [[nodiscard]] const std::filesystem::path& scene() const { return scene_; }
  [[nodiscard]] int bits() const { return bits_; }  ///< of a drive code
  [[nodiscard]] const std::vector<RecordedFrame>& frames() const& { return frames_; }
  /// The frames of another run of the same walk, `name` in the run's folder.
  [[nodiscard]] Result<std::vector<RecordedFrame>> frames_in(const std::string& name) const;
  /// Where a body truly was; one that nobody scripted does not move.
  [[nodiscard]] RigidTransform world_from_body(tracking::BodyId body, Duration when) const;

 private:
  std::filesystem::path folder_;
  std::filesystem::path scene_;
  int bits_ = 0;
  Duration tracker_start_{};
  std::map<tracking::BodyId, tracking::Path> paths_;
  std::vector<RecordedFrame> frames_;
};

}  // namespace veneer::cli
