// SPDX-License-Identifier: Apache-2.0
#include "base/testing/fuzzing.h"
#include "base/testing/memory_file.h"
#include "render/scene.h"

namespace veneer::render {
namespace {

constexpr double kMostMetres = 1000;
constexpr double kMostLight = 1e7;

bool is_near(const Eigen::Vector3d& x) { return x.cwiseAbs().maxCoeff() <= kMostMetres; }
bool is_light(const Eigen::Vector3d& rgb) {
  return rgb.minCoeff() >= 0 && rgb.maxCoeff() <= kMostLight;
}

std::string laws_of(const Scene& scene) {
  if (scene.mesh.triangles.empty()) return "a scene without a mesh";
  if (scene.lights.empty() || scene.lights.size() > kMaxLights) return "the number of lights";
  for (const Light& light : scene.lights) {
    if (const auto* sun = std::get_if<DirectionalLight>(&light)) {
      if (!(std::abs(sun->direction_to_light.norm() - 1) < 1e-9)) return "no unit direction";
      if (!is_light(sun->illuminance_rgb)) return "an illuminance that no target holds";
    } else {
      const auto& lamp = std::get<PointLight>(light);
      if (!is_near(lamp.position)) return "a light out of this world";
      if (!is_light(lamp.intensity_rgb)) return "an intensity that no target holds";
    }
  }
  if (!is_near(scene.world_from_object.translation)) return "an object out of this world";
  if (!(std::abs(scene.world_from_object.rotation.norm() - 1) < 1e-9)) return "no rotation";
  if (!is_near(scene.eye_in_sensor)) return "an eye out of this world";
  if (!(scene.texture_repeats.minCoeff() > 0)) return "repeats";
  if (scene.observer_bodies.empty() || scene.object_body < -1) return "bodies";
  for (const int body : scene.observer_bodies)
    if (body < 0) return "a negative body";
  return "";
}

Verdict read(std::string_view text) {
  static const MemoryFile kFile;
  kFile.write(text);
  const auto scene = Scene::load(kFile.path());
  if (!scene) return refused(scene.error());
  return accepted(laws_of(*scene));
}

}  // namespace
}  // namespace veneer::render

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace render;
  static const FuzzedReader kReader{
      &read,
      {"mesh = \"plate\"\ntexture_repeats = [6.0, 3.0]\n[object]\nposition = [0, 0, 0]\n"
       "rotation_deg = [0, 10, 0]\ntracker_body = -1\n[observer]\ntracker_bodies = [1, 2]\n"
       "eye = \"left\"\nleft_eye_in_sensor = [-0.03, 0, 0]\n[[light]]\nkind = \"directional\"\n"
       "direction = [0.3, 0.5, 0.8]\nilluminance_lux = 300\ncolour = [1, 1, 1]\n",
       "mesh = \"plate\"\n[observer]\neye = \"midpoint\"\nleft_eye_in_sensor = [-0.03, 0, 0]\n"
       "right_eye_in_sensor = [0.03, 0, 0]\n[[light]]\nkind = \"point\"\nposition = [1, 2, 3]\n"
       "intensity_cd = 1e3\ncolour = [1, 0.5, 0]\n[[light]]\ndirection = [0, 0, 1]\n"
       "illuminance_lux = 1\n"},
      {64 << 10, 160},
      {"mesh = \"/dev/null\"\n[[light]]\ndirection = [0, 0, 1]\nilluminance_lux = 1\n"}};
  return kReader;
}
