// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// For each texel a diffuse colour, and for each measured view a specular colour and `lobes` lobes
/// in the light direction alone, as Meseth, Mueller, Klein 2003, "Preserving Realism in Real-Time
/// Rendering of Bidirectional Texture Functions":
///
///     light.z (diffuse + sum_v w_v specular_v sum_i max(0, (a, b, c)_vi . light)^n_vi)
///
/// with w the weights of the three views around the view, by DirectionLookup; beyond the views
/// those of the border count. Colours >= 0, n 1 to 200. The cosine that is in every sample stands
/// outside. A view whose lobes do not converge has none; a texel whose lobes gain nothing stays
/// diffuse.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_reflectance_field(const SampleSet& set,
                                                                      const FitOptions& options,
                                                                      Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_reflectance_field(const SafetensorsFile& file);

}  // namespace veneer::btf
