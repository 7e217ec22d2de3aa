// SPDX-License-Identifier: Apache-2.0
#include "daemon/observers.h"

#include <algorithm>

namespace veneer::daemon {

using tracking::BodyId;
using tracking::PoseEstimate;
using tracking::PoseOrigin;

Observers::Observers(const PoseFeed& poses,
                     const std::vector<BodyId>& bodies,
                     const tracking::PresenceOptions& options)
    : poses_(poses), bodies_(bodies), options_(options), filter_(options), current_(bodies.at(0)) {}

bool Observers::known(Time when) const {
  return std::ranges::any_of(bodies_, [this, when](BodyId body) {
    return poses_.at(body, when).origin != PoseOrigin::kNone;
  });
}

bool Observers::is_fresh(BodyId body, Time when) const {
  const PoseEstimate estimate = poses_.at(body, when);
  return estimate.origin != PoseOrigin::kNone && to_seconds(estimate.age) <= options_.stale_s;
}

Observers::View Observers::at(Time when) {
  if (!is_fresh(current_, when)) {
    for (const BodyId body : bodies_) {
      if (body == current_ || !is_fresh(body, when)) continue;
      current_ = body;
      if (begun_) filter_.start_over();
      break;
    }
  }
  View view;
  view.body = current_;
  view.estimate = poses_.at(current_, when);
  view.seen = filter_.update(view.estimate, when);
  begun_ = true;
  return view;
}

}  // namespace veneer::daemon
