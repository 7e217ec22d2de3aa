// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <filesystem>
#include <optional>
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

/// Where an eye or a light may be: a part of a thick sphere. Seen from the centre, azimuth goes
/// from +z towards +x of the world, elevation from the x-z plane towards +y. Of directional lights
/// only the angles matter.
struct Region {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< world frame, metres
  Eigen::Vector2d radius{1, 1};                      ///< least and most, metres, > 0
  Eigen::Vector2d azimuth{0, 0};                     ///< radians, at most a turn apart
  Eigen::Vector2d elevation{0, 0};                   ///< radians, -pi/2 to pi/2
};
/// A point of a region. @param at  in [0, 1]^3, evenly over angles (by area) and radius.
[[nodiscard]] Eigen::Vector3d point_in(const Region& region, const Eigen::Vector3d& at);

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
///     [observer.region]              # where the eye may be; for what is planned and measured
///     centre = [0, 0, 0]
///     radius_m = [0.8, 1.2]
///     azimuth_deg = [-30, 30]        # from +z towards +x
///     elevation_deg = [0, 20]
///     [[light]]                      # one or more; at most 4
///     kind = "directional"           # or "point"
///     direction = [0.3, 0.5, 0.8]    # to the light, or position = [...] for a point
///     illuminance_lux = 300          # or intensity_cd for a point
///     colour = [1, 1, 1]             # linear sRGB, multiplies
///     [light.region]                 # where this light may be moved to; keys as the observer's
struct Scene {
  Mesh mesh;
  std::string mesh_name;
  Eigen::Vector2d texture_repeats{1, 1};
  RigidTransform world_from_object;
  int object_body = -1;
  std::vector<int> observer_bodies{0};
  /// The point for which is drawn, whichever keys say it.
  Eigen::Vector3d eye_in_sensor = Eigen::Vector3d::Zero();
  std::optional<Region> observer_region;
  std::vector<Light> lights;
  std::vector<std::optional<Region>> light_regions;  ///< of each light; empty where none has one

  /// Errors: kNotFound, kBadFormat (mesh), kInvalidOption (an unknown key, a value out of range).
  [[nodiscard]] static Result<Scene> load(const std::filesystem::path& path);
};

inline constexpr int kMaxLights = 4;

}  // namespace veneer::render
