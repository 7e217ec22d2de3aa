// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// Local PCA of RGB samples with the Eigen-BRDFs resampled to the grid of the elevated concentric
/// map, in a volume texture that the hardware interpolates in three of the directions' four
/// coordinates: two fetches for each component.
///
/// `components` is one number. `precision` is that of the Eigen-BRDFs. "8bit" (the default) rounds
/// each to 127 steps on either side of 0 of its largest magnitude, and folds that scale into the
/// weights: signed, so that 0 stays 0 and a light fades to black at the horizon. A rounding is off
/// by at most 1/254 of the largest magnitude. "float16" rounds to 11 binary digits.
/// reconstruct() rounds Eigen-BRDFs at the measured directions so, without the grid; radiance()
/// reads the grid's nodes, which are rounded once, not twice. The file keeps the Eigen-BRDFs at the
/// measured directions in float16, whatever the precision.
///
/// Source: Schneider 2004, "Real-time BTF Rendering", section 6.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_revised_lpca(const SampleSet& set,
                                                                 const FitOptions& options,
                                                                 Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_revised_lpca(const SafetensorsFile& file);

}  // namespace veneer::btf
