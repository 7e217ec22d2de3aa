// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "base/result.h"
#include "base/rigid_transform.h"
#include "render/scene.h"

namespace veneer::quality {

/// From where, and on what, a frame is looked at.
struct Viewpoint {
  Eigen::Vector3d eye_in_world = Eigen::Vector3d::Zero();  ///< metres
  RigidTransform world_from_object;
};

/// `count` places spread evenly over the scene's observer region (Scene::observer_region), the same
/// each time; the object stands as the scene says. Errors: kInvalidOption (a scene without a
/// region, with what to add to it; count < 1).
[[nodiscard]] Result<std::vector<Viewpoint>> viewpoints_of(const render::Scene& scene, int count);

}  // namespace veneer::quality
