// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/material.h"

namespace veneer::btf {

/// Local PCA of RGB samples with the Eigen-BRDFs kept at the measured directions and interpolated
/// between the three nearest views and the three nearest lights, as Mueller, Meseth, Klein 2003,
/// "Compression and Real-Time Rendering of Measured BTFs Using Local PCA". `components` is one
/// number.
[[nodiscard]] Result<std::unique_ptr<Material>> fit_lpca(const SampleSet& set,
                                                         const FitOptions& options,
                                                         Progress& progress);
[[nodiscard]] Result<std::unique_ptr<Material>> load_lpca(const SafetensorsFile& file);

}  // namespace veneer::btf
