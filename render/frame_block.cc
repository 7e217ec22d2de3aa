// SPDX-License-Identifier: Apache-2.0
#include "render/frame_block.h"

#include <numbers>

#include "base/colour.h"

namespace veneer::render {
namespace {

Eigen::Vector4f homogeneous(const Eigen::Vector3d& v, double w) {
  return Eigen::Vector4d(v.x(), v.y(), v.z(), w).cast<float>();
}

struct LightUniform {
  Eigen::Vector4f light;
  Eigen::Vector4f rgb;
};

LightUniform uniform_of(const Light& light, const RigidTransform& object_from_world) {
  // A material's sample is its radiance times pi over the irradiance.
  if (const auto* sun = std::get_if<DirectionalLight>(&light))
    return {homogeneous(object_from_world.rotation * sun->direction_to_light, 0.0),
            homogeneous(sun->illuminance_rgb / std::numbers::pi, 0.0)};
  const auto& lamp = std::get<PointLight>(light);
  return {homogeneous(object_from_world * lamp.position, 1.0),
          homogeneous(lamp.intensity_rgb / std::numbers::pi, 0.0)};
}

}  // namespace

FrameBlock frame_block(std::span<const Light> lights,
                       const Eigen::Vector2d& texture_repeats,
                       const Eigen::Matrix4d& clip_from_world,
                       const Eigen::Vector3d& projector_in_world,
                       double reference_distance_m,
                       const DrawInput& input) {
  const RigidTransform object_from_world = input.world_from_object.inverse();
  FrameBlock block;
  block.clip_from_object = (clip_from_world * input.world_from_object.matrix()).cast<float>();
  block.xyz_from_rgb = Eigen::Matrix4f::Identity();
  block.xyz_from_rgb.topLeftCorner<3, 3>() = xyz_from_srgb().cast<float>();
  block.eye = homogeneous(object_from_world * input.eye_in_world, 1.0);
  block.projector = homogeneous(object_from_world * projector_in_world,
                                reference_distance_m * reference_distance_m);
  block.texture_repeats = texture_repeats.cast<float>();
  block.specular_weight = static_cast<float>(input.specular_weight);
  block.unused = 0.0F;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const LightUniform light = uniform_of(lights[i], object_from_world);
    block.lights[i] = light.light;
    block.lights[lights.size() + i] = light.rgb;
  }
  return block;
}

}  // namespace veneer::render
