// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "calibration/profile.h"
#include "render/scene.h"

// Scenes for the tests of this module.
namespace veneer::quality::testing {

inline constexpr double kDegree = std::numbers::pi / 180.0;

/// A plain machine of 8 bits on +z before the origin, which a built-in object does not leave.
inline calibration::ProjectorProfile front_projector(double distance_m = 1.0) {
  calibration::ProjectorProfile profile;
  auto& g = profile.geometry;
  g.width = 320;
  g.height = 240;
  g.fx = g.fy = 600 * distance_m;
  g.cx = 160;
  g.cy = 120;
  g.world_from_projector = look_at({0, 0, distance_m}, {0, 0, 0}, {0, 1, 0});
  for (auto& curve : profile.tone_curves)
    for (int code = 0; code < 256; ++code) curve.push_back(std::pow(code / 255.0, 2.2));
  profile.primaries = 400.0 * xyz_from_srgb();
  profile.black = {0.2, 0.2, 0.25};
  profile.reference_distance_m = distance_m;
  profile.vignetting = Image<float>(1, 1, 1.0F);
  return profile;
}

inline render::Scene scene_of(const std::string& mesh) {
  render::Scene scene;
  auto loaded = load_mesh(mesh);
  if (!loaded) throw std::runtime_error(loaded.error().what);
  scene.mesh = *loaded;
  scene.mesh_name = mesh;
  return scene;
}

/// A place seen from the origin: azimuth from +z towards +x, elevation towards +y.
inline Eigen::Vector3d place(double azimuth_deg, double elevation_deg, double distance_m = 1.0) {
  const double a = azimuth_deg * kDegree;
  const double e = elevation_deg * kDegree;
  return distance_m *
         Eigen::Vector3d(std::cos(e) * std::sin(a), std::sin(e), std::cos(e) * std::cos(a));
}

inline render::Region arc(double from_deg, double to_deg, double elevation_deg, double distance_m) {
  return {Eigen::Vector3d::Zero(),
          {distance_m, distance_m},
          {from_deg * kDegree, to_deg * kDegree},
          {elevation_deg * kDegree, elevation_deg * kDegree}};
}

/// A plate under one fixed light from 45 degrees, for an eye that keeps to an arc.
inline render::Scene plate(double from_deg, double to_deg, double distance_m) {
  render::Scene scene = scene_of("plate");
  scene.observer_region = arc(from_deg, to_deg, 20, distance_m);
  scene.lights = {render::DirectionalLight{place(0, 45), {300, 300, 300}}};
  scene.light_regions = {std::nullopt};
  return scene;
}

}  // namespace veneer::quality::testing
