// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "daemon/pose_feed.h"
#include "tracking/presence.h"

namespace veneer::daemon {

/// Whose eye the picture is for: one of the bodies that a scene names. He stays the one until he
/// has not been seen for a while and another is; then it is that other's picture, whose highlights
/// fade in.
class Observers {
 public:
  /// @param poses   borrowed; has tracks of all bodies.
  /// @param bodies  at least one; the first that is seen begins.
  Observers(const PoseFeed& poses,
            const std::vector<tracking::BodyId>& bodies,
            const tracking::PresenceOptions& options);

  struct View {
    tracking::BodyId body = 0;
    tracking::PoseEstimate estimate;
    tracking::BodyView seen;
  };
  /// @param when  not before that of the call before.
  [[nodiscard]] View at(Time when);
  /// Whether any of them was ever seen.
  [[nodiscard]] bool known(Time when) const;
  [[nodiscard]] const std::vector<tracking::BodyId>& bodies() const { return bodies_; }

 private:
  [[nodiscard]] bool is_fresh(tracking::BodyId body, Time when) const;

  const PoseFeed& poses_;
  std::vector<tracking::BodyId> bodies_;
  tracking::PresenceOptions options_;
  tracking::PresenceFilter filter_;
  tracking::BodyId current_;
  bool begun_ = false;
};

}  // namespace veneer::daemon
