// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "base/mesh.h"
#include "base/result.h"
#include "base/rigid_transform.h"
#include "base/units.h"

namespace veneer::render {

/// A light of the virtual world in which the material is shown (not the projector).
struct DirectionalLight {
  Eigen::Vector3d direction_to_light{0, 0, 1};  ///< world frame, unit
  Eigen::Vector3d illuminance_rgb{1, 1, 1};     ///< linear sRGB, lux on a plane facing the light
};
struct PointLight {
  Eigen::Vector3d position{0, 0, 1};       ///< world frame, metres
  Eigen::Vector3d intensity_rgb{1, 1, 1};  ///< linear sRGB, candela
};
using Light = std::variant<DirectionalLight, PointLight>;

/// What is shown on what, for whom: scene.toml. Relative paths in it refer to its folder.
///
///     mesh = "sphere"                # built-in name or file
///     texture_repeats = [6.0, 3.0]   # repeats of the sample over u, v in [0, 1]
///     [object]                       # world_from_object
///     position = [0, 0, 0]
///     rotation_deg = [0, 0, 0]       # about x, then y, then z
///     tracker_body = -1              # >= 0: the pose comes from the tracker instead
///     [observer]
///     tracker_body = 0               # or tracker_bodies = [1, 2]: whoever is seen
///     eye_in_sensor = [0.0, 0.0, 0.0]  # metres in the body's frame; or, where both were measured:
///     # eye = "left"                 # "left", "right" or "midpoint": for which eye is drawn
///     # left_eye_in_sensor = [-0.03, 0.0, 0.0]
///     # right_eye_in_sensor = [0.03, 0.0, 0.0]
///     [[light]]                      # one or more; at most 4
///     kind = "directional"           # or "point"
///     direction = [0.3, 0.5, 0.8]    # to the light, or position = [...] for a point
///     illuminance_lux = 300          # or intensity_cd for a point
///     colour = [1, 1, 1]             # linear sRGB, multiplies
struct Scene {
  Mesh mesh;
  std::string mesh_name;
  Eigen::Vector2d texture_repeats{1, 1};
  RigidTransform world_from_object;
  int object_body = -1;
  std::vector<int> observer_bodies{0};
  /// The point for which is drawn, whichever keys say it.
  Eigen::Vector3d eye_in_sensor = Eigen::Vector3d::Zero();
  std::vector<Light> lights;

  /// Errors: kNotFound, kBadFormat (mesh), kInvalidOption (an unknown key, a value out of range).
  [[nodiscard]] static Result<Scene> load(const std::filesystem::path& path);
};

inline constexpr int kMaxLights = 4;

}  // namespace veneer::render
