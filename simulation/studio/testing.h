// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <limits>
#include <numbers>

#include "btf/direction.h"
#include "capture/plan.h"
#include "simulation/studio/truth.h"

// What the tests of this folder share.

namespace veneer::simulation::testing {

inline constexpr double kDegree = std::numbers::pi / 180;
inline constexpr double kPerfect = std::numeric_limits<double>::infinity();

inline btf::Direction toward(double theta_deg, double phi_deg) {
  return btf::direction_from_angles({theta_deg * kDegree, phi_deg * kDegree});
}
/// In the plane of x and the normal, positive towards x.
inline btf::Direction on_arc(double angle_deg) {
  return {std::sin(angle_deg * kDegree), 0, std::cos(angle_deg * kDegree)};
}

/// Quick to trace and to photograph; without faults. A texel is 4 x 4 pixels and stands on whole
/// ones, so that a pixel sees one texel only.
inline StudioTruth small_truth() {
  StudioTruth t;
  t.samples = 4;
  t.light_extinction = kPerfect;
  t.analyser_extinction = kPerfect;
  t.misalignment_deg = 0;
  t.ambient = 0;
  t.light_fall_off = 0;
  t.width = 160;
  t.height = 120;
  t.principal_point = {80, 60};
  t.focal_px = 1600;  // 2 pixels a millimetre
  t.distance_mm = 800;
  t.full_well = 1e12;
  t.read_noise = 0;
  t.dark_current = 0;
  t.fixed_pattern = 0;
  t.offset_counts = 0;
  t.vignetting = 0;
  t.bits = 16;
  return t;
}

/// 8 x 8 texels of 2 mm in the middle of a board of 66 x 54 mm.
inline capture::CapturePlan small_plan() {
  capture::CapturePlan plan;
  plan.name = "small";
  plan.board = {11, 9, 6, 4.2, "DICT_4X4_100"};
  plan.area.left_mm = 25;
  plan.area.top_mm = 19;
  plan.area.width_mm = 16;
  plan.area.height_mm = 16;
  plan.area.columns = 8;
  plan.area.rows = 8;
  plan.lights = {on_arc(10), on_arc(-30), toward(45, 45)};
  plan.views = {on_arc(0), on_arc(20)};
  plan.mirror_light = 0;
  plan.ball_radius_mm = 8;
  return plan;
}

}  // namespace veneer::simulation::testing
