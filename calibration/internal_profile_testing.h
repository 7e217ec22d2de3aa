// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "calibration/profile.h"

// Profiles for the tests of this module.
namespace veneer::calibration {

/// Numbers without a short decimal form, so that a round trip that rounds is noticed.
inline ProjectorProfile example_profile() {
  ProjectorProfile p;
  p.geometry = {64, 48, 100.0 / 3.0, 33.4, 31.0 + 1.0 / 7.0, 24.1, {}};
  p.geometry.world_from_projector =
      look_at({0.25, 0.35, 1.15}, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitY());
  p.bits = 4;
  for (std::size_t c = 0; c < 3; ++c)
    for (int code = 0; code < 16; ++code)
      p.tone_curves[c].push_back(std::pow(code / 15.0, 2.0 + 0.1 * static_cast<double>(c)));
  p.primaries << 330.0 / 7, 250.0 / 7, 140.0 / 7, 160.0 / 7, 500.0 / 7, 60.0 / 7, 10.0 / 7,
      70.0 / 7, 760.0 / 7;
  p.black = {0.1 / 3, 0.1 / 3, 0.1 / 3};
  p.reference_distance_m = 1.2;
  p.vignetting = Image<float>(3, 2, 0.9F);
  p.vignetting(1, 1) = 1.0F / 3.0F;
  p.surface << 0.8, 0.01 / 3, 0, 0.001, 0.75, 0, 0, 0, 0.6;
  p.ambient = {1.9, 2.0, 2.1};
  return p;
}

inline ProjectorProfile example_with_map() {
  ProjectorProfile p = example_profile();
  p.surface_map = Image<Rgb32f>(2, 3, Rgb32f(1.0F, 0.9F, 1.1F));
  p.surface_map(1, 2) = Rgb32f(1.0F / 3.0F, 0.02F, 2.5F);
  return p;
}

inline ProjectorProfile example_with_residual() {
  ProjectorProfile p = example_with_map();
  p.residual = ColourResidual::sampled(5, [](const Eigen::Vector3d& t) -> Eigen::Vector3d {
    return t.minCoeff() * Eigen::Vector3d(0.2, 0.25, 1.0 / 3) - 0.05 * t.x() * t;
  });
  p.colour_model = "white segment";
  p.record = {{"instrument", "a colorimeter, \u00b1 2 %"}, {"when", "2026-11-28T01:02:03Z"}};
  return p;
}

/// A lens that is shifted up, out of the raster, turned and moved: nothing of it is round.
inline ProjectorGeometry example_geometry() {
  ProjectorGeometry g;
  g.width = 1280;
  g.height = 800;
  g.fx = 1900;
  g.fy = 1850.125;
  g.cx = 652.25;
  g.cy = 910.5;
  g.world_from_projector.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized());
  g.world_from_projector.translation = {0.5, -1.0, 2.0};
  return g;
}

}  // namespace veneer::calibration
