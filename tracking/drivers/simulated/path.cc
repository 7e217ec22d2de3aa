// SPDX-License-Identifier: Apache-2.0
#include "tracking/drivers/simulated/path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/units.h"

namespace veneer::tracking {
namespace {

constexpr double kUnset = std::numeric_limits<double>::quiet_NaN();

/// Reads a number that has to be there and in [low, high].
Status require_in(TomlReader& toml, std::string_view key, double low, double high, double& value) {
  value = kUnset;
  toml.require(key, value);
  if (value >= low && value <= high) return {};
  return fail(Errc::kInvalidOption,
              "reading a tracker path: give {} a number from {} to {}",
              key,
              low,
              high);
}

Status require_angle(TomlReader& toml, std::string_view key, double& angle_rad) {
  double angle_deg = 0;
  VENEER_TRY(require_in(toml, key, -36000, 36000, angle_deg));
  angle_rad = to_radians(Degrees{angle_deg}).value;
  return {};
}

/// There and back between two angles, at rest at both ends.
struct Swing {
  double from_rad = 0;
  double to_rad = 0;
  double period_s = 0;

  Status read(TomlReader& toml) {
    VENEER_TRY(require_angle(toml, "from_deg", from_rad));
    VENEER_TRY(require_angle(toml, "to_deg", to_rad));
    return require_in(toml, "period_s", 1e-2, 1e6, period_s);
  }
  [[nodiscard]] double angle_rad(double seconds) const {
    const double there = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * seconds / period_s);
    return from_rad + there * (to_rad - from_rad);
  }
};

/// A circle around a point; an observer on it faces the point.
struct Circle {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius_m = 0;
  double height_m = 0;

  Status read(TomlReader& toml) {
    toml.read("centre", centre);
    VENEER_TRY(require_in(toml, "radius_m", 1e-3, 1e3, radius_m));
    return require_in(toml, "height_m", -1e3, 1e3, height_m);
  }
  [[nodiscard]] RigidTransform observer(double angle_rad) const {
    const Eigen::Vector3d offset(
        radius_m * std::sin(angle_rad), height_m, radius_m * std::cos(angle_rad));
    return look_at(centre + offset, centre, Eigen::Vector3d::UnitY());
  }
};

struct Waypoint {
  double time_s = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // of the curve, m/s
};

Result<std::vector<Waypoint>> read_points(TomlReader& toml) {
  std::vector<Waypoint> points;
  for (TomlReader& table : toml.tables("waypoint")) {
    Waypoint point;
    VENEER_TRY(require_in(table, "time_s", 0, 1e6, point.time_s));
    table.require("position", point.position);
    if (!points.empty() && point.time_s - points.back().time_s < 1e-3) {
      return fail(Errc::kInvalidOption,
                  "reading a tracker path: waypoint {} is at {} s, not at least 1 ms after the one "
                  "before it; put waypoints in the order of time",
                  points.size(),
                  point.time_s);
    }
    points.push_back(point);
  }
  if (points.size() < 2) {
    return fail(
        Errc::kInvalidOption,
        "reading a tracker path: kind \"waypoints\" needs two or more [[tracker.path.waypoint]] "
        "tables, found {}",
        points.size());
  }
  return points;
}

/// Lets the curve pass a waypoint with the mean velocity from its predecessor to its successor
/// (Catmull and Rom 1974, for uneven times); it starts and ends at rest.
void choose_velocities(std::vector<Waypoint>& points) {
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    points[i].velocity = (points[i + 1].position - points[i - 1].position) /
                         (points[i + 1].time_s - points[i - 1].time_s);
  }
}

/// The curve through at least two waypoints, cubic between two of them (Hermite's form).
Eigen::Vector3d position_at(const std::vector<Waypoint>& points, double seconds) {
  const auto after = std::ranges::upper_bound(points, seconds, {}, &Waypoint::time_s);
  if (after == points.begin()) return points.front().position;
  if (after == points.end()) return points.back().position;
  const Waypoint& a = *std::prev(after);
  const Waypoint& b = *after;
  const double span_s = b.time_s - a.time_s;
  const double t = (seconds - a.time_s) / span_s;
  const double s = 1 - t;
  return s * s * (1 + 2 * t) * a.position + t * t * (1 + 2 * s) * b.position +
         span_s * s * t * (s * a.velocity - t * b.velocity);
}

}  // namespace

Result<Path> Path::read(TomlReader& toml) {
  BodyId body = 0;
  std::string kind;
  toml.read("body", body);
  toml.read("kind", kind);
  Result<Motion> (*read_motion)(TomlReader&) = nullptr;
  if (kind == "walk") read_motion = &read_walk;
  if (kind == "orbit") read_motion = &read_orbit;
  if (kind == "fixed") read_motion = &read_fixed;
  if (kind == "turn") read_motion = &read_turn;
  if (kind == "waypoints") read_motion = &read_waypoints;
  if (read_motion == nullptr) {
    return fail(Errc::kInvalidOption,
                "reading a tracker path: kind is \"{}\"; set it to \"walk\", \"orbit\", \"fixed\", "
                "\"turn\" or \"waypoints\"",
                kind);
  }
  VENEER_ASSIGN(Motion motion, read_motion(toml));
  return Path(body, std::move(motion));
}

Result<Path::Motion> Path::read_walk(TomlReader& toml) {
  Circle circle;
  Swing swing;
  VENEER_TRY(circle.read(toml));
  VENEER_TRY(swing.read(toml));
  return [=](double seconds) { return circle.observer(swing.angle_rad(seconds)); };
}

Result<Path::Motion> Path::read_orbit(TomlReader& toml) {
  Circle circle;
  double from_rad = 0;
  double rate_rad_s = 0;
  VENEER_TRY(circle.read(toml));
  VENEER_TRY(require_angle(toml, "from_deg", from_rad));
  VENEER_TRY(require_angle(toml, "rate_deg_s", rate_rad_s));
  return [=](double seconds) { return circle.observer(from_rad + seconds * rate_rad_s); };
}

Result<Path::Motion> Path::read_fixed(TomlReader& toml) {
  RigidTransform fixed;
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();
  toml.read("position", fixed.translation);
  toml.read("rotation_deg", rotation_deg);
  if (rotation_deg.cwiseAbs().maxCoeff() > 360) {
    return fail(Errc::kInvalidOption,
                "reading a tracker path: give rotation_deg three angles up to 360");
  }
  const double angle_rad = to_radians(Degrees{rotation_deg.norm()}).value;
  if (angle_rad > 0) fixed.rotation = Eigen::AngleAxisd(angle_rad, rotation_deg.normalized());
  return [=](double /*seconds*/) { return fixed; };
}

Result<Path::Motion> Path::read_turn(TomlReader& toml) {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();
  Swing swing;
  toml.read("position", position);
  toml.read("axis", axis);
  VENEER_TRY(swing.read(toml));
  if (!(axis.norm() > 1e-9 && axis.allFinite()))
    return fail(Errc::kInvalidOption,
                "reading a tracker path: give axis a vector that is not zero, such as [0, 1, 0]");
  axis.normalize();
  return [=](double seconds) {
    return RigidTransform{Eigen::Quaterniond(Eigen::AngleAxisd(swing.angle_rad(seconds), axis)),
                          position};
  };
}

Result<Path::Motion> Path::read_waypoints(TomlReader& toml) {
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  toml.require("look_at", target);
  VENEER_ASSIGN(std::vector<Waypoint> points, read_points(toml));
  choose_velocities(points);
  return [target, points = std::move(points)](double seconds) {
    return look_at(position_at(points, seconds), target, Eigen::Vector3d::UnitY());
  };
}

Result<std::vector<Path>> Path::read_all(TomlReader& toml) {
  std::vector<Path> paths;
  for (TomlReader& table : toml.tables("path")) {
    VENEER_ASSIGN(Path path, Path::read(table));
    if (std::ranges::find(paths, path.body(), &Path::body) != paths.end()) {
      return fail(
          Errc::kInvalidOption,
          "opening the simulated tracker: body {} has two paths; give every path a body of its own",
          path.body());
    }
    paths.push_back(std::move(path));
  }
  if (paths.empty()) {
    return fail(Errc::kInvalidOption,
                "opening the simulated tracker: there is no path; add a [[tracker.path]] table");
  }
  return paths;
}

}  // namespace veneer::tracking
