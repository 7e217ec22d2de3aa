// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/progress.h"
#include "base/result.h"
#include "btf/interpolated_set.h"
#include "calibration/profile.h"
#include "quality/plan/plan.h"
#include "render/scene.h"

namespace veneer::quality {

/// Places of the observer that a plan is looked at from, and pixels that are compared from each.
constexpr int kPlanViews = 4;
constexpr int kPlanPixels = 2000;

/// Draws what was chosen, and the fits for any scene where there are any, in the scene that was
/// planned for, and notes how far each is from the full BTF on the projector's raster
/// (PlannedFit::on_screen). Every pixel is drawn by itself, the raster at its own size.
/// Makes an EGL context.
/// @param set  that the plan was made for.
/// Errors: those of viewpoints_of(), ScreenReference::make() and measure_on_screen().
[[nodiscard]] Status measure_plan_on_screen(Plan& plan,
                                            const btf::InterpolatedSet& set,
                                            const render::Scene& scene,
                                            const calibration::ProjectorProfile& profile,
                                            Progress& progress);

}  // namespace veneer::quality
