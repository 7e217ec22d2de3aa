// SPDX-License-Identifier: Apache-2.0
#include "render/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "base/toml_reader.h"

namespace veneer::render {
namespace {

// Beyond this the texture coordinates, interpolated in single precision, no longer tell the texels
// of a 1000-texel sample apart.
constexpr double kMaxRepeats = 1000.0;
// Outside this, products of light and material leave the range of the half floats that are drawn
// to.
constexpr double kMaxLight = 1e7;

bool is_built_in(std::string_view mesh) {
  constexpr std::array<std::string_view, 4> kBuiltIn{"sphere", "plate", "cylinder", "vase"};
  return std::ranges::find(kBuiltIn, mesh) != kBuiltIn.end();
}

// Far beyond any hall; single precision still tells tenths of a millimetre apart there.
constexpr double kMostMetres = 1000.0;

bool is_near(const Eigen::Vector3d& x) {
  return x.allFinite() && x.cwiseAbs().maxCoeff() <= kMostMetres;
}
constexpr std::string_view kNear = "must be finite, and from -1000 to 1000 metres";

// A finite value in [0, kMaxLight].
bool is_amount_of_light(double value) { return value >= 0.0 && value <= kMaxLight; }

constexpr double kMostElevation_deg = 90.0;
constexpr double kMostTurn_deg = 360.0;

std::optional<Region> read_region(TomlReader& parent) {
  if (!parent.contains("region")) return std::nullopt;
  TomlReader toml = parent.table("region");
  Region region;
  toml.read("centre", region.centre);
  if (!is_near(region.centre)) toml.add_error("centre", kNear);
  toml.read("radius_m", region.radius);
  if (!(region.radius.x() > 0.0 && region.radius.x() <= region.radius.y() &&
        region.radius.y() <= kMostMetres))
    toml.add_error("radius_m", "must be two numbers above 0, ascending, at most 1000");
  const auto read_angles = [&](std::string_view key, Eigen::Vector2d& angles) {
    Eigen::Vector2d deg = Eigen::Vector2d::Zero();
    toml.read(key, deg);
    angles = {to_radians(Degrees{deg.x()}).value, to_radians(Degrees{deg.y()}).value};
    return deg;
  };
  const Eigen::Vector2d azimuth = read_angles("azimuth_deg", region.azimuth);
  if (!(azimuth.cwiseAbs().maxCoeff() <= kMostTurn_deg && azimuth.x() <= azimuth.y() &&
        azimuth.y() - azimuth.x() <= kMostTurn_deg))
    toml.add_error("azimuth_deg",
                   "must be two angles within -360 to 360, ascending, at most 360 apart");
  const Eigen::Vector2d elevation = read_angles("elevation_deg", region.elevation);
  if (!(elevation.cwiseAbs().maxCoeff() <= kMostElevation_deg && elevation.x() <= elevation.y()))
    toml.add_error("elevation_deg", "must be two angles within -90 to 90, ascending");
  return region;
}

Light read_light(TomlReader& toml) {
  std::string kind = "directional";
  toml.read("kind", kind);
  Eigen::Vector3d colour(1, 1, 1);
  toml.read("colour", colour);
  if (!colour.allFinite() || colour.minCoeff() < 0.0)
    toml.add_error("colour", "must be three finite numbers, none below 0");
  double amount = 0.0;
  // Each may be in range, and both together out of that of half floats, which would be white.
  const auto check_product = [&toml](const Eigen::Vector3d& rgb) {
    if (!(rgb.maxCoeff() <= kMaxLight))
      toml.add_error("colour", "times the amount of light must be at most 1e7");
  };
  if (kind == "point") {
    PointLight light;
    toml.require("position", light.position);
    if (!is_near(light.position)) toml.add_error("position", kNear);
    toml.require("intensity_cd", amount);
    if (!is_amount_of_light(amount)) toml.add_error("intensity_cd", "must be from 0 to 1e7");
    light.intensity_rgb = amount * colour;
    check_product(light.intensity_rgb);
    return light;
  }
  if (kind != "directional") toml.add_error("kind", "must be \"directional\" or \"point\"");
  DirectionalLight light;
  toml.require("direction", light.direction_to_light);
  const double length = light.direction_to_light.norm();
  if (!(length > 0.0) || !std::isfinite(length)) {
    toml.add_error("direction", "must be finite and not zero");
  } else {
    light.direction_to_light /= length;
  }
  toml.require("illuminance_lux", amount);
  if (!is_amount_of_light(amount)) toml.add_error("illuminance_lux", "must be from 0 to 1e7");
  light.illuminance_rgb = amount * colour;
  check_product(light.illuminance_rgb);
  return light;
}

void read_object(TomlReader toml, Scene& scene) {
  toml.read("position", scene.world_from_object.translation);
  if (!is_near(scene.world_from_object.translation)) toml.add_error("position", kNear);
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();
  toml.read("rotation_deg", rotation_deg);
  if (!rotation_deg.allFinite()) toml.add_error("rotation_deg", "must be finite");
  const auto turn = [&](int axis) {
    return Eigen::AngleAxisd(to_radians(Degrees{rotation_deg[axis]}).value,
                             Eigen::Vector3d::Unit(axis));
  };
  scene.world_from_object.rotation = turn(2) * turn(1) * turn(0);
  toml.read("tracker_body", scene.object_body);
  if (scene.object_body < -1)
    toml.add_error("tracker_body", "must be a body's number, or -1 for none");
}

/// The eye by itself, or `eye` and the eyes of which it chooses.
Eigen::Vector3d read_eye(TomlReader& toml) {
  constexpr std::string_view kLeft = "left_eye_in_sensor";
  constexpr std::string_view kRight = "right_eye_in_sensor";
  const auto point = [&](std::string_view key) {
    Eigen::Vector3d value = Eigen::Vector3d::Zero();
    toml.read(key, value);
    if (!is_near(value)) toml.add_error(key, kNear);
    return value;
  };
  std::string eye;
  toml.read("eye", eye);
  const Eigen::Vector3d single = point("eye_in_sensor");
  const Eigen::Vector3d left = point(kLeft);
  const Eigen::Vector3d right = point(kRight);
  if (!toml.contains("eye")) {
    for (const std::string_view key : {kLeft, kRight}) {
      if (toml.contains(key))
        toml.add_error(key, "say which eye is meant: eye = \"left\", \"right\" or \"midpoint\"");
    }
    return single;
  }
  if (eye != "left" && eye != "right" && eye != "midpoint") {
    toml.add_error("eye", "must be \"left\", \"right\" or \"midpoint\"");
    return single;
  }
  if (toml.contains("eye_in_sensor")) {
    toml.add_error("eye_in_sensor",
                   fmt::format("stands beside eye = \"{}\", which takes left_eye_in_sensor and "
                               "right_eye_in_sensor; remove one of the two",
                               eye));
  }
  for (const std::string_view key : {kLeft, kRight}) {
    const bool needed = eye == "midpoint" || key.substr(0, eye.size()) == eye;
    if (needed && !toml.contains(key))
      toml.add_error("eye", fmt::format("is \"{}\", and {} is missing", eye, key));
  }
  if (eye == "midpoint") return 0.5 * (left + right);
  return eye == "left" ? left : right;
}

void read_observer(TomlReader toml, Scene& scene) {
  const bool several = toml.contains("tracker_bodies");
  const std::string_view key = several ? "tracker_bodies" : "tracker_body";
  if (several && toml.contains("tracker_body")) {
    toml.add_error(key, "stands beside tracker_body; give one of them");
  }
  if (several) {
    toml.read(key, scene.observer_bodies);
  } else {
    toml.read(key, scene.observer_bodies.front());
  }
  if (scene.observer_bodies.empty()) toml.add_error(key, "must name a body");
  for (const int body : scene.observer_bodies) {
    if (body < 0) toml.add_error(key, "must be bodies' numbers, 0 or more");
  }
  scene.eye_in_sensor = read_eye(toml);
  scene.observer_region = read_region(toml);
}

}  // namespace

Eigen::Vector3d point_in(const Region& region, const Eigen::Vector3d& at) {
  const auto between = [](const Eigen::Vector2d& ends, double t) {
    return ends.x() + t * (ends.y() - ends.x());
  };
  const double azimuth = between(region.azimuth, at.x());
  const Eigen::Vector2d heights(std::sin(region.elevation.x()), std::sin(region.elevation.y()));
  const double height = std::clamp(between(heights, at.y()), -1.0, 1.0);
  const double level = std::sqrt(1.0 - height * height);
  const Eigen::Vector3d direction(level * std::sin(azimuth), height, level * std::cos(azimuth));
  return region.centre + between(region.radius, at.z()) * direction;
}

Result<Scene> Scene::load(const std::filesystem::path& path) {
  VENEER_ASSIGN(TomlReader toml, TomlReader::open(path));
  Scene scene;
  toml.require("mesh", scene.mesh_name);
  toml.read("texture_repeats", scene.texture_repeats);
  if (!(scene.texture_repeats.minCoeff() > 0.0) ||
      !(scene.texture_repeats.maxCoeff() <= kMaxRepeats))
    toml.add_error("texture_repeats", "both must be above 0 and at most 1000");
  read_object(toml.table("object"), scene);
  read_observer(toml.table("observer"), scene);
  for (TomlReader& light : toml.tables("light")) {
    scene.lights.push_back(read_light(light));
    scene.light_regions.push_back(read_region(light));
  }
  if (scene.lights.empty() || scene.lights.size() > kMaxLights)
    toml.add_error(
        "light",
        fmt::format("a scene has 1 to {} lights, not {}", kMaxLights, scene.lights.size()));
  VENEER_TRY(toml.finish());
  const std::filesystem::path mesh = is_built_in(scene.mesh_name)
                                         ? std::filesystem::path(scene.mesh_name)
                                         : toml.folder() / scene.mesh_name;
  VENEER_ASSIGN(scene.mesh, load_mesh(mesh));
  return scene;
}

}  // namespace veneer::render
