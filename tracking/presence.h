// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "base/clock.h"
#include "base/result.h"
#include "base/toml_reader.h"
#include "tracking/pose.h"

namespace veneer::tracking {

/// How well it is known where a body is.
enum class Presence {
  kNone,     ///< never seen
  kTracked,  ///< measured, or predicted from fresh samples
  kHeld,     ///< the prediction has run out; a moment ago it was tracked
  kStale,    ///< not seen for PresenceOptions::stale_s
  kLost,     ///< not seen for PresenceOptions::lost_s
};
[[nodiscard]] std::string_view name_of(Presence presence);

/// What is done about a body that is not seen; keys of the [presence] table.
struct PresenceOptions {
  double stale_s = 0.1;   ///< age at which it counts as stale. > 0
  double lost_s = 0.5;    ///< and as lost. >= stale_s
  double fade_s = 0.3;    ///< in which the certainty goes from 1 to 0, or back. > 0
  double blend_s = 0.08;  ///< in which the shown pose goes from the held to the measured one. >= 0
  double jump_m = 0.05;   ///< farther than this it does not go, it jumps. >= 0
  /// Reads the keys and records what is out of range.
  [[nodiscard]] static PresenceOptions read(TomlReader& toml);
};

/// What is to be shown of a body at a moment.
struct BodyView {
  Presence presence = Presence::kNone;
  RigidTransform world_from_body;
  /// 1: what depends on just where the body is may be shown; 0: nobody knows where it is.
  double certainty = 0;
};

/// Turns the estimates of one body, frame after frame, into poses that do not jump when it is found
/// again, and a certainty that fades out when it is lost and in when it is back. The pose of a lost
/// body stays where it was last seen.
class PresenceFilter {
 public:
  explicit PresenceFilter(const PresenceOptions& options) : options_(options) {}
  /// @param when  the moment of the estimate; not before that of the call before.
  [[nodiscard]] BodyView update(const PoseEstimate& estimate, Time when);
  /// Somebody else is meant from now on: the certainty fades in anew.
  void start_over();

 private:
  [[nodiscard]] Presence presence_of(const PoseEstimate& estimate) const;

  PresenceOptions options_;
  BodyView shown_;
  double first_certainty_ = 1;  // nobody saw anything else before
  std::optional<Time> when_;
  RigidTransform blend_from_;
  std::optional<Time> blend_since_;
};

}  // namespace veneer::tracking
