// SPDX-License-Identifier: Apache-2.0
#include "render/scene_check.h"

namespace veneer::render {
namespace {

bool is_finite(const DirectionalLight& light) {
  return light.direction_to_light.allFinite() && light.illuminance_rgb.allFinite();
}
bool is_finite(const PointLight& light) {
  return light.position.allFinite() && light.intensity_rgb.allFinite();
}

}  // namespace

Status check_drawable(const Scene& scene) {
  const Mesh& mesh = scene.mesh;
  if (scene.lights.empty() || scene.lights.size() > kMaxLights)
    return fail(Errc::kBadFormat,
                "drawing a scene: the scene has {} lights; 1 to {} can be drawn",
                scene.lights.size(),
                kMaxLights);
  const std::size_t count = mesh.positions.size();
  if (mesh.triangles.empty() || mesh.normals.size() != count ||
      mesh.texture_coordinates.size() != count)
    return fail(Errc::kBadFormat,
                "drawing a scene: the mesh has {} triangles, {} positions, {} normals and {} "
                "texture coordinates; it needs triangles, and one of the others for every vertex",
                mesh.triangles.size(),
                count,
                mesh.normals.size(),
                mesh.texture_coordinates.size());
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      if (vertex >= count)
        return fail(Errc::kBadFormat,
                    "drawing a scene: a triangle of the mesh names vertex {} of {}",
                    vertex,
                    count);
    }
  }
  for (const Light& light : scene.lights) {
    const bool finite = std::visit([](const auto& l) { return is_finite(l); }, light);
    if (!finite)
      return fail(Errc::kBadFormat,
                  "drawing a scene: a light of the scene has a direction, a position or an "
                  "intensity that is no number; correct the scene");
  }
  return {};
}

}  // namespace veneer::render
