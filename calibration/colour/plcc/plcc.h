// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>

#include "calibration/colour/colour_model.h"

namespace veneer::calibration {

/// Piecewise linear, constant chromaticity: a channel is its colour at full drive times its
/// relative luminance, which is straight between the levels of the ramp. Source: Post and Calhoun
/// 1989, "An Evaluation of Methods for Producing Desired Colors on CRT Monitors".   Errors: those
/// of read_ramps().
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_plcc(std::span<const PatchReading> patches,
                                                            const Xyz& black);

/// The same with a monotone cubic between the levels.
[[nodiscard]] Result<std::unique_ptr<ColourModel>> fit_plcc_spline(
    std::span<const PatchReading> patches, const Xyz& black);

}  // namespace veneer::calibration
