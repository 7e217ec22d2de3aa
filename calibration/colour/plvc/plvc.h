// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// Piecewise linear, variable chromaticity: X, Y and Z of a channel each follow the ramp, straight
/// between its levels; what a channel's colour does over its drive is kept.
/// Source: Thomas, Hardeberg, Foucherot and Gouton 2008, "The PLVC Display Color
/// Characterization Model Revisited" (via its excerpts).   Errors: those of read_ramps().
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_plvc(std::span<const PatchReading> patches,
                                                            const Xyz& black);

/// The same with a smooth cubic between the levels.
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_plvc_spline(
    std::span<const PatchReading> patches, const Xyz& black);

}  // namespace veneer::calibration
