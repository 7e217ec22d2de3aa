// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// For each texel a diffuse colour and a lobe about the mirror direction, as Phong 1975,
/// "Illumination for Computer Generated Pictures":
///
///     diffuse light.z + strength max(0, mirrored light . view)^n
///
/// The lobe has the light's own colour, white, and no cosine: 5 values a texel, n 1 to 200, all
/// others >= 0. Black where the light is below the horizon; a view below it counts as on it. The
/// exponent is searched for, so that no start is needed; the rest is linear.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_phong(const SampleSet& set,
                                                          const FitOptions& options,
                                                          Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_phong(const SafetensorsFile& file);

}  // namespace veneer::btf
