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
  constexpr std::array<std::string_view, 3> kBuiltIn{"sphere", "plate", "vase"};
  return std::ranges::find(kBuiltIn, mesh) != kBuiltIn.end();
}

// A finite value in [0, kMaxLight].
bool is_amount_of_light(double value) { return value >= 0.0 && value <= kMaxLight; }

Light read_light(TomlReader& toml) {
  std::string kind = "directional";
  toml.read("kind", kind);
  Eigen::Vector3d colour(1, 1, 1);
  toml.read("colour", colour);
  if (!colour.allFinite() || colour.minCoeff() < 0.0)
    toml.add_error("colour", "must be three finite numbers, none below 0");
  double amount = 0.0;
  if (kind == "point") {
    PointLight light;
    toml.require("position", light.position);
    if (!light.position.allFinite()) toml.add_error("position", "must be finite");
    toml.require("intensity_cd", amount);
    if (!is_amount_of_light(amount)) toml.add_error("intensity_cd", "must be from 0 to 1e7");
    light.intensity_rgb = amount * colour;
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
  return light;
}

void read_object(TomlReader toml, Scene& scene) {
  toml.read("position", scene.world_from_object.translation);
  if (!scene.world_from_object.translation.allFinite())
    toml.add_error("position", "must be finite");
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
  toml.read("eye_in_sensor", scene.eye_in_sensor);
  if (!scene.eye_in_sensor.allFinite()) toml.add_error("eye_in_sensor", "must be finite");
}

}  // namespace

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
  for (TomlReader& light : toml.tables("light")) scene.lights.push_back(read_light(light));
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
