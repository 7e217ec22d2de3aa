// SPDX-License-Identifier: Apache-2.0
#pragma once

// Internal to render/.

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <span>

#include "base/rigid_transform.h"
#include "render/scene.h"

namespace veneer::render {

/// Where a frame is seen from and drawn on.
struct DrawInput {
  Eigen::Vector3d eye_in_world;
  RigidTransform world_from_object;
  double specular_weight = 1.0;  ///< as FrameInput's
};

/// The block Frame of frame.glsl, with room for every light; a program reads as much as it
/// declares.
struct FrameBlock {
  Eigen::Matrix4f clip_from_object;
  Eigen::Matrix4f xyz_from_rgb;
  Eigen::Vector4f eye;
  Eigen::Vector4f projector;
  Eigen::Vector2f texture_repeats;
  float specular_weight;
  float unused;
  std::array<Eigen::Vector4f, 2 * kMaxLights> lights;  // lights[n], then light_rgb[n]
};
static_assert(offsetof(FrameBlock, lights) == 2 * 64 + 3 * 16);

/// @param lights  at most kMaxLights.
[[nodiscard]] FrameBlock frame_block(std::span<const Light> lights,
                                     const Eigen::Vector2d& texture_repeats,
                                     const Eigen::Matrix4d& clip_from_world,
                                     const Eigen::Vector3d& projector_in_world,
                                     double reference_distance_m,
                                     const DrawInput& input);

}  // namespace veneer::render
