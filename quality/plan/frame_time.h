// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/result.h"
#include "btf/material.h"
#include "calibration/profile.h"
#include "render/scene.h"

namespace veneer::quality {

/// Milliseconds that the draw pass takes on this machine, the median over places of the observer's
/// region, every pixel drawn by itself. Errors: those of the renderer and of viewpoints_of().
[[nodiscard]] Result<double> draw_ms(const render::Scene& scene,
                                     const calibration::ProjectorProfile& profile,
                                     const btf::Material& material);

}  // namespace veneer::quality
