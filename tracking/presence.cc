// SPDX-License-Identifier: Apache-2.0
#include "tracking/presence.h"

#include <algorithm>
#include <cmath>

namespace veneer::tracking {
namespace {

void read_seconds(TomlReader& toml, std::string_view key, double& value, bool zero_is_good) {
  toml.read(key, value);
  if (!(zero_is_good ? value >= 0 : value > 0) || !(value <= 3600)) {
    toml.add_error(
        key, fmt::format("{} is not {} 0, at most 3600", value, zero_is_good ? "from" : "above"));
  }
}

/// From 0 to 1 with no edge at either end.
double smooth_step(double part) { return part * part * (3 - 2 * part); }

}  // namespace

std::string_view name_of(Presence presence) {
  switch (presence) {
    case Presence::kNone:
      return "none";
    case Presence::kTracked:
      return "tracked";
    case Presence::kHeld:
      return "held";
    case Presence::kStale:
      return "stale";
    case Presence::kLost:
      return "lost";
  }
  return "unknown";
}

PresenceOptions PresenceOptions::read(TomlReader& toml) {
  PresenceOptions options;
  read_seconds(toml, "stale_s", options.stale_s, false);
  read_seconds(toml, "lost_s", options.lost_s, false);
  read_seconds(toml, "fade_s", options.fade_s, false);
  read_seconds(toml, "blend_s", options.blend_s, true);
  toml.read("jump_m", options.jump_m);
  if (!(options.jump_m >= 0) || !std::isfinite(options.jump_m)) {
    toml.add_error("jump_m", fmt::format("{} is not 0 or more", options.jump_m));
  }
  if (options.lost_s < options.stale_s) {
    toml.add_error("lost_s",
                   fmt::format("{} is before stale_s, {}", options.lost_s, options.stale_s));
  }
  return options;
}

Presence PresenceFilter::presence_of(const PoseEstimate& estimate) const {
  if (estimate.origin == PoseOrigin::kNone) return Presence::kNone;
  const double age_s = to_seconds(estimate.age);
  if (age_s > options_.lost_s) return Presence::kLost;
  if (age_s > options_.stale_s) return Presence::kStale;
  return estimate.origin == PoseOrigin::kHeld ? Presence::kHeld : Presence::kTracked;
}

void PresenceFilter::start_over() {
  shown_ = {};
  first_certainty_ = 0;
  when_.reset();
  blend_since_.reset();
}

BodyView PresenceFilter::update(const PoseEstimate& estimate, Time when) {
  const BodyView before = shown_;
  shown_.presence = presence_of(estimate);
  shown_.world_from_body = estimate.world_from_body;

  const double passed_s = when_ ? std::max(0.0, to_seconds(when - *when_)) : 0;
  when_ = when;
  const bool known = shown_.presence != Presence::kNone && shown_.presence != Presence::kLost;
  const double most = passed_s / options_.fade_s;
  const bool first = known && before.presence == Presence::kNone;
  shown_.certainty =
      first ? first_certainty_
            : std::clamp(known ? before.certainty + most : before.certainty - most, 0.0, 1.0);

  const bool was_away = before.presence == Presence::kHeld || before.presence == Presence::kStale ||
                        before.presence == Presence::kLost;
  if (was_away && shown_.presence == Presence::kTracked) {
    const double way_m =
        (estimate.world_from_body.translation - before.world_from_body.translation).norm();
    blend_from_ = before.world_from_body;
    blend_since_.reset();
    if (way_m <= options_.jump_m) blend_since_ = when - from_seconds(passed_s);
  }
  if (blend_since_) {
    const double since_s = to_seconds(when - *blend_since_);
    if (since_s >= options_.blend_s) {
      blend_since_.reset();
    } else {
      const double part = smooth_step(since_s / options_.blend_s);
      const RigidTransform& to = estimate.world_from_body;
      shown_.world_from_body = {
          blend_from_.rotation.slerp(part, to.rotation).normalized(),
          blend_from_.translation + part * (to.translation - blend_from_.translation)};
    }
  }
  return shown_;
}

}  // namespace veneer::tracking
