// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// For each texel a diffuse colour and `lobes` Lafortune lobes with diagonal matrices under one
/// specular colour, as McAllister, Lastra, Heidrich 2002, "Efficient Rendering of Spatial
/// Bi-directional Reflectance Distribution Functions":
///
///     light.z (diffuse + specular sum_i max(0, C_i . (view light))^n_i)
///
/// with the product element by element, n 1 to 200, colours >= 0. The cosine that is in every
/// sample stands outside, so that the rest is reciprocal and light fades to the horizon by itself.
/// A view below the horizon counts as on it. Fitted to RGB, all channels at once.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_lafortune(const SampleSet& set,
                                                              const FitOptions& options,
                                                              Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_lafortune(const SafetensorsFile& file);

}  // namespace veneer::btf
