// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/rigid_transform.h"
#include "base/toml_reader.h"
#include "tracking/pose.h"

namespace veneer::tracking {

/// A scripted motion, known exactly at any time: what a simulated tracker measures, and the ground
/// truth beside it.
///
/// The world is right-handed with +y up. An angle on an arc is 0 along +z and grows towards +x,
/// seen from the arc's centre. The body of a moving observer has its origin at the eye point, +z
/// forward (where it looks), x right, y down; it keeps its head level.
class Path {
 public:
  /// Reads one [[tracker.path]] table: `body`, `kind` and the keys of that kind.
  ///
  ///   walk       centre, radius_m, height_m, from_deg, to_deg, period_s: on an arc around a point,
  ///              there and back in a period, at rest at both ends, facing the point
  ///   orbit      centre, radius_m, height_m, from_deg, rate_deg_s: on a circle at a constant rate,
  ///              facing the point
  ///   fixed      position, rotation_deg (a rotation vector: the axis times the angle)
  ///   turn       position, axis, from_deg, to_deg, period_s: on the spot about an axis, there and
  ///              back in a period, at rest at both ends
  ///   waypoints  look_at and [[tracker.path.waypoint]] tables with time_s, position: a smooth
  ///   curve
  ///              (continuous velocity) through them, at rest before the first and after the last
  ///
  /// `height_m` is counted from the centre. Errors: kInvalidOption.
  [[nodiscard]] static Result<Path> read(TomlReader& toml);

  /// Reads all [[path]] tables of `toml`: one or more, each body once. Errors: kInvalidOption.
  [[nodiscard]] static Result<std::vector<Path>> read_all(TomlReader& toml);

  [[nodiscard]] BodyId body() const { return body_; }
  /// The true world_from_body at `seconds` after the path's time zero; any finite time.
  /// Thread-safe.
  [[nodiscard]] RigidTransform at(double seconds) const { return motion_(seconds); }

 private:
  /// world_from_body at a time in seconds.
  using Motion = std::function<RigidTransform(double)>;

  Path(BodyId body, Motion motion) : body_(body), motion_(std::move(motion)) {}
  static Result<Motion> read_walk(TomlReader& toml);
  static Result<Motion> read_orbit(TomlReader& toml);
  static Result<Motion> read_fixed(TomlReader& toml);
  static Result<Motion> read_turn(TomlReader& toml);
  static Result<Motion> read_waypoints(TomlReader& toml);

  BodyId body_;
  Motion motion_;
};

}  // namespace veneer::tracking
