// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// The lobes of `lafortune` times an RGB factor T for each texel and measured view, which stands
/// for what hides a texel from some views; after Daubert, Lensch, Heidrich, Seidel 2001, "Efficient
/// Cloth Modeling and Rendering", with one set of lobes for all channels as Meseth et al. 2003,
/// section 3.2. Between views T is interpolated by DirectionLookup, beyond them it is that of the
/// border, so that any view of a set with one view has the same T. T and the lobes are fitted in
/// turn, T >= 0.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_scaled_lafortune(const SampleSet& set,
                                                                     const FitOptions& options,
                                                                     Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_scaled_lafortune(const SafetensorsFile& file);

}  // namespace veneer::btf
