// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "btf/fit_region.h"
#include "calibration/profile.h"
#include "quality/viewpoints.h"
#include "render/scene.h"

namespace veneer::quality {

/// What a scene can ask of a BTF: which (view, light) pairs of the local frame occur on the part of
/// the surface that the projector reaches, for all places of the observer and all lights in their
/// regions, and how often.
struct Reach {
  btf::FitRegion region;               ///< the pairs' density over the measured ones, and the boxes
  double reached_pairs = 0;            ///< part of the measured pairs with any weight, 0 to 1
  double view_theta_max = 0;           ///< radians
  double light_theta_max = 0;          ///< radians
  double below_horizon = 0;            ///< part of what is asked where view or light is below it
  double texels_per_pixel_median = 0;  ///< along a pixel's side
  double texels_per_pixel_p95 = 0;
};

/// Errors: kInvalidOption (nothing of the object is lit by the projector; no observer region).
[[nodiscard]] Result<Reach> find_reach(const render::Scene& scene,
                                       const calibration::ProjectorProfile& profile,
                                       const btf::SampleSetInfo& set,
                                       Progress& progress);

}  // namespace veneer::quality
