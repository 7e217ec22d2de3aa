// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/recording.h"
#include "tracking/tracker.h"

namespace veneer::tracking {

/// What to replay; keys of the [tracker] table.
struct ReplayOptions {
  /// The recording; relative to the configuration file.
  std::filesystem::path file;
  /// Begin again at the end, for ever.
  bool loop = false;
  /// 2 is twice as fast as it was recorded. 0.01 to 100.
  double speed = 1;
  [[nodiscard]] Status check() const;
};

/// Replays a recording at its own pace: the first sample comes at once, the others as long after it
/// as they were measured after it. Stamps are moved to the tracker's clock; order, faults and
/// sequence numbers stay as recorded, and go on growing when it loops.
class ReplayTracker final : public Tracker {
 public:
  /// Reads ReplayOptions and goes through the whole file once, so that a damaged one is refused
  /// here.
  /// @param clock  borrowed; must outlive the tracker.
  /// Errors: kInvalidOption, kNotFound, kBadFormat.
  [[nodiscard]] static Result<std::unique_ptr<ReplayTracker>> open(TomlReader& config,
                                                                   Clock& clock);

  /// Says so where the recording's last line was cut short.
  [[nodiscard]] std::string description() const override;
  [[nodiscard]] bool ends() const override { return !options_.loop; }
  /// kDisconnected after the last sample, unless it loops.
  [[nodiscard]] Result<PoseSample> wait_pose(Duration timeout) override;

 private:
  /// What the first pass over the file found.
  struct Contents {
    std::uint64_t samples = 0;
    bool truncated = false;
    Time first;                                      // stamp of the sample that is replayed first
    Duration period{};                               // from one beginning to the next when it loops
    std::map<BodyId, std::uint64_t> sequence_steps;  // by how much numbers grow from loop to loop
  };
  ReplayTracker(ReplayOptions options, Contents contents, PoseRecordingReader reader, Clock& clock);
  [[nodiscard]] static Result<Contents> scan(const std::filesystem::path& file);
  /// The next sample of the file, stamped for this clock. Errors: kDisconnected.
  [[nodiscard]] Result<PoseSample> fetch();

  ReplayOptions options_;
  Contents contents_;
  PoseRecordingReader reader_;
  Clock& clock_;
  Time start_;
  std::uint64_t loops_ = 0;            // finished ones
  std::optional<PoseSample> waiting_;  // fetched, not due yet
};

}  // namespace veneer::tracking
